"""The command line: the catalogue of FMUs, and scenarios.

Results go to stdout (one JSON value with `--json`), messages and progress to stderr. Exit codes:
0 done, 1 the work failed, 2 wrong usage or input.

Modules of this folder import at their top what declares the commands; what does the work is
imported by the command, so that `--help` answers at once.
"""

from __future__ import annotations

import contextlib
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import CheckError, CosimError, InputError
from ..installation.builder import default_provider
from ..master import algorithms
from ..spec import distribution
from ..system.provider import FolderProvider, Provider
from .arm import arm_app
from .calibrate import calibrate_command
from .data import data_app
from .diagnose import diagnose_command
from .export import draw_command, export_command
from .figures import figures_command
from .fmus import fmus_app
from .guard import applies, guarded
from .linearize import linearize_command
from .monitor import monitor_command
from .new import new_app
from .output import AsJson, new_table, open_console, say
from .pairs import pairs, values
from .progress import Display
from .scenarios import scenarios_command
from .signals import taken
from .streams import print_json, stdout_for_json
from .study import study_command
from .twin import twin_command
from .view import view_command

if TYPE_CHECKING:
    from ..running.runner import Result

app = typer.Typer(
    invoke_without_command=True,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
)
app.add_typer(fmus_app, name="fmus")
app.add_typer(arm_app, name="arm")
app.add_typer(data_app, name="data")
app.add_typer(new_app, name="new")
app.command("scenarios")(scenarios_command)
app.command("calibrate")(calibrate_command)
app.command("diagnose")(diagnose_command)
app.command("monitor")(monitor_command)
app.command("linearize")(linearize_command)
app.command("export")(export_command)
app.command("draw")(draw_command)
app.command("figures")(figures_command)
app.command("study")(study_command)
app.command("twin")(twin_command)
app.command("view")(view_command)


@app.callback()
def whole(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and stop.", is_eager=True)
    ] = False,
) -> None:
    """Robot subsystems as FMUs, run together and compared with measurements."""
    if version:
        typer.echo(f"cosim {distribution.version()} ({distribution.NAME})")
        raise typer.Exit


SHOWN = 40
"""Comparisons and passed checks that are printed; more are in result.json only."""
SHOWN_FOLDERS = 8
"""Folders of results that are named one by one."""


@app.command("run")
def run_command(
    name: Annotated[
        str, typer.Argument(metavar="SCENARIO", help="Name, folder, .toml or .ssp file.")
    ],
    variants: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="INSTANCE=VARIANT", help="E.g. gearbox=elastic+backlash."),
    ] = None,
    parameters: Annotated[
        list[str] | None,
        typer.Option("--param", metavar="INSTANCE.NAME=VALUE", help="E.g. gearbox.eta=0.8."),
    ] = None,
    algorithm: Annotated[
        str | None, typer.Option(help=f"One of {', '.join(algorithms.names())}.")
    ] = None,
    options: Annotated[
        list[str] | None,
        typer.Option("--option", metavar="NAME=VALUE", help="E.g. extrapolation=1."),
    ] = None,
    step: Annotated[float | None, typer.Option(help="Communication step [s].")] = None,
    duration: Annotated[float | None, typer.Option(help="Duration [s].")] = None,
    record: Annotated[
        list[str] | None,
        typer.Option(metavar="SIGNAL", help="Record this, too, e.g. motor.i; may be repeated."),
    ] = None,
    record_period: Annotated[
        float | None, typer.Option(help="Time between recorded points [s].")
    ] = None,
    fmus: Annotated[
        Path | None, typer.Option(help="Take variants from this folder instead of building.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for results [out/SCENARIO].")] = None,
    isolate: Annotated[
        bool, typer.Option("--isolate", help="Run in a process of its own: FMUs may crash or hang.")
    ] = False,
    time_limit: Annotated[
        float, typer.Option(help="With --isolate: longest time of one call to an FMU [s].")
    ] = 60.0,
    as_json: AsJson = False,
) -> None:
    """Run a scenario, compare it with its reference, plot it.

    Example: `cosim run motor_bench --set gearbox=elastic+backlash --param gearbox.eta=0.8`
    """
    from ..report.run_page import write_run_page
    from ..running.runner import run

    changes = pairs(variants, "--set", "INSTANCE=VARIANT")
    given = values(parameters, "--param", "INSTANCE.NAME=VALUE")
    chosen = values(options, "--option", "NAME=VALUE")
    if fmus is not None and not fmus.is_dir():
        raise InputError(f"--fmus {fmus}: there is no such folder")
    folder = out or Path("out") / _folder_name(name)
    with Display() as display:
        provider: Provider = (
            FolderProvider(fmus) if fmus is not None else default_provider(display.building)
        )
        result = run(
            name,
            variants=changes,
            parameters=given,
            algorithm=algorithm,
            options=chosen,
            step=step,
            duration=duration,
            record=record or (),
            record_period=record_period,
            provider=provider,
            out=folder,
            progress=lambda item, fraction: display.update(item, fraction, 1.0),
            isolate=time_limit if isolate else None,
            guard=True,
        )
        page = write_run_page(result, provider, folder / "report.html")
    result = replace(result, files=(*result.files, page))
    for note in dict.fromkeys(note for item in result.runs.values() for note in item.notes):
        say(f"note: {note}")
    if as_json:
        print_json(result.to_dict())
    else:
        _print_result(result)
    failed = [label for label, check in result.checks.items() if check.failed]
    if failed:
        shown = "; ".join(failed[:5]) + ("; ..." if len(failed) > 5 else "")
        raise CheckError(f"{len(failed)} of {len(result.checks)} checks failed: {shown}")


def _folder_name(name: str) -> str:
    for suffix in (".toml", ".ssp", ".ssd"):
        name = name.removesuffix(suffix)
    return name.strip("./")


def _print_result(result: Result) -> None:
    content, console = result.to_dict(), open_console()
    console.print(
        f"{content['scenario']}: {content['simulated_s']:g} s simulated in "
        f"{content['wall_s']:.2f} s, {content['fmu_steps']} FMU-steps, {content['algorithm']} with "
        f"{content['step']:g} s; the coupling invented {content['energy_residual_J']:.3g} J",
        soft_wrap=True,
    )
    for quantity in result.overview if len(result.runs) > 1 else ():
        head, rows = quantity.rows()
        table = new_table(*head)
        for row in rows:
            table.add_row(*row)
        console.print(table)
    if 0 < len(content["comparison"]) <= SHOWN:
        table = new_table("compared", "rms", "max", "unit", "with")
        for key, item in content["comparison"].items():
            table.add_row(
                key, f"{item['rms']:.4g}", f"{item['max']:.4g}", item["unit"], item["reference"]
            )
        console.print(table)
    shown = content["checks"]
    if len(shown) > SHOWN:
        shown = [item for item in shown if item["ok"] is False]
        met = sum(item["ok"] is True for item in content["checks"])
        console.print(f"{met} of {len(content['checks'])} checks ok")
    if shown:
        table = new_table("check", "value", "limit", "", "source")
        for item in shown:
            outcome = {True: "ok", False: "FAILED", None: "not judged"}[item["ok"]]
            limit = item["limit"]
            bound = f"{limit:.4g}" if isinstance(limit, float) else str(limit)
            value = "-" if item["value"] is None else f"{item['value']:.4g}"
            table.add_row(item["name"], value, bound, outcome, item["source"])
        console.print(table)
    for reason, names in _unjudged(content["checks"]).items():
        console.print(f"not judged: {', '.join(names)}: {reason}", soft_wrap=True)
    folders = list(dict.fromkeys(str(path.parent) for path in result.files))
    if len(folders) > SHOWN_FOLDERS:
        console.print(f"in {len(folders) - 1} folders below {folders[-1]}", soft_wrap=True)
    for folder in folders if len(folders) <= SHOWN_FOLDERS else ():
        console.print(f"in {folder}", soft_wrap=True)
    console.print(f"page: {result.files[-1]}", soft_wrap=True)
    pictures = [path for path in result.files if path.suffix == ".png"]
    for path in pictures[-1:] if pictures and pictures[-1].name == "overview.png" else pictures:
        console.print(f"picture: {path}", soft_wrap=True)


def _unjudged(checks: list[dict[str, Any]]) -> dict[str, list[str]]:
    """Why checks are not judged -> their names."""
    found: dict[str, list[str]] = {}
    for item in checks:
        if "not_judged" in item:
            found.setdefault(item["not_judged"], []).append(item["name"])
    return found


# -- frame -----------------------------------------------------------------------------------------


@contextlib.contextmanager
def leaving_nothing() -> Iterator[None]:
    """Let SIGTERM end the block like an error: what it has started and made is put away."""

    def terminate() -> None:
        say("terminated")
        raise SystemExit(128 + signal.SIGTERM)

    with taken(signal.SIGTERM, terminate):
        yield


def main() -> None:
    """Run the command line; one line on stderr per error, no traceback."""
    if note := distribution.shadowed():
        say(note)
    if applies(sys.argv[1:]):
        _said(lambda: guarded(lambda: _said(_run)))
    else:
        _said(_run)


def _run() -> None:
    with leaving_nothing(), stdout_for_json() if "--json" in sys.argv[1:] else nullcontext():
        app()


def _said(work: Callable[[], None]) -> None:
    """Do some work; what goes wrong is said."""
    try:
        work()
    except CosimError as error:
        say(f"error: {error}")
        for note in getattr(error, "__notes__", ()):
            say(note)
        raise SystemExit(error.exit_code) from None
    except KeyboardInterrupt:
        say("interrupted")
        raise SystemExit(130) from None
