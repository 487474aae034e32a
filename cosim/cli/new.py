"""The command `cosim new system`: a system of one's own, with comments."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from ..installation.builder import default_provider
from .output import AsJson, new_table, open_console, say
from .pairs import values
from .streams import print_json

new_app = typer.Typer(help="Begin something of your own.", no_args_is_help=True)


@new_app.callback()
def _new() -> None:
    """Begin something of your own."""


@new_app.command("system")
def system_command(
    name: Annotated[str, typer.Argument(help="Of the robot; its folder is called so.")] = "",
    template: Annotated[str, typer.Option(help="Kind of robot; without it, those there are.")] = "",
    device: Annotated[
        str, typer.Option(help="Of --template arm: what 'cosim arm import' has made.")
    ] = "",
    parameters: Annotated[
        list[str] | None,
        typer.Option("--param", metavar="NAME=VALUE", help="E.g. track=0.35; SI units."),
    ] = None,
    components: Annotated[
        list[str] | None,
        typer.Option("--from", metavar="VARIANT", help="Component, variant or .fmu; repeatable."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder [NAME].")] = None,
    logs: Annotated[bool, typer.Option(help="Simulate example logs, too.")] = True,
    as_json: AsJson = False,
) -> None:
    """Write a system and a scenario that runs it, with comments.

    From a template with your dimensions, and a mapping of logs; or from components (--from),
    connected where names tell: `cosim data import` writes a mapping of your logs then.

    Example: `cosim new system my_base --template diff_drive --param track=0.35`
    """
    from ..robots import arms, composed, create, templates

    if not name or not (template or components):
        if name and not as_json:
            say("give --template KIND or --from COMPONENT; the templates:")
        _print_templates(as_json)
        if name:
            raise InputError(f"what is {name!r} made of? Give --template or --from")
        return
    if template and components:
        raise InputError("--template and --from exclude each other")
    if not re.fullmatch(r"\w[\w-]*", name):
        raise InputError(f"{name!r}: the name of a robot has letters, digits, - and _ only")
    given = values(parameters, "--param", "NAME=VALUE")
    folder = out or Path(name)
    if template == "arm":
        made = arms.write(name, folder, device, given, default_provider(), logs=logs)
    elif template:
        chosen = templates.read(template, given)
        made = create.from_template(name, folder, chosen, default_provider(), logs=logs)
    else:
        made = composed.write(name, folder, components or (), given, default_provider())
    if as_json:
        print_json({"name": name, "files": [str(path) for path in made]})
        return
    for path in made:
        typer.echo(str(path))
    say(f"cosim run {folder.as_posix()}" + ("" if components else f"   cosim calibrate {folder}"))


def _print_templates(as_json: bool) -> None:
    from ..robots import templates

    found = [templates.read(name, {}) for name in templates.names()]
    if as_json:
        print_json(
            [
                {
                    "template": item.name, "description": item.table["text"],
                    "parameters": {
                        key: {"value": entry["value"], "unit": entry["unit"], "text": entry["text"]}
                        for key, entry in item.parameters.items()
                    },
                }
                for item in found
            ]
        )  # fmt: skip
        return
    table = new_table("template", "robot", "--param", "", "means")
    for item in found:
        first = (item.name, item.table["text"])
        for key, entry in item.parameters.items() or [("", {})]:
            shown = f"{entry.get('value', '')} {entry.get('unit', '')}".strip()
            table.add_row(*first, key, shown, entry.get("text", ""))
            first = ("", "")
    open_console().print(table)
