"""The commands of `cosim fmus`: the catalogue, and building."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import InputError, VariantError, listing
from ..installation import places
from ..installation.builder import naming_errors, sources
from .check import check_command
from .output import AsJson, new_table, open_console, say
from .streams import print_json

fmus_app = typer.Typer(
    help="The component catalogue: list, build and check FMUs.", no_args_is_help=True
)


fmus_app.command("check")(check_command)


class Kind(StrEnum):
    """Kinds of FMUs that can be built."""

    native = "native"
    python = "python"


class Platform(StrEnum):
    """Platforms that FMUs can be built for."""

    host = "host"
    all = "all"


def _describe_file(path: Path) -> dict[str, Any]:
    """What `fmus list` says, from an FMU instead of the sources."""
    from ..fmu.archive import open_fmu

    description = open_fmu(path).description

    def listed(causality: Any) -> list[dict[str, str]]:
        return [
            {"name": v.name, "unit": v.symbol, "description": v.text}
            for v in description.of(causality)
        ]

    return {
        "variant": description.extra.get("variant", description.name),
        "component": description.extra.get("component", ""),
        "fidelity": description.extra.get("fidelity", ""),
        "effects": description.extra.get("effects", []),
        "inputs": listed("input"),
        "outputs": listed("output"),
        "parameters": listed("parameter"),
        "states": [],
        "description": description.text,
    }


@fmus_app.command("list")
def fmus_list(
    component: Annotated[str, typer.Argument(help="Variants of this component.")] = "",
    every: Annotated[bool, typer.Option("--all", help="All variants of all components.")] = False,
    containing: Annotated[
        str, typer.Option("--filter", help="Only variants whose name contains this.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """List the component catalogue: components, or variants with what they offer.

    With --json always variants, of all components if none is named.

    Example: `cosim fmus list`, `cosim fmus list gearbox`, `cosim fmus list --filter backlash`
    """
    if not (component or every or containing or as_json):
        _print_components(_components())
        return
    entries = [
        entry for entry in _variants(component, containing) if containing in entry["variant"]
    ]
    if component and not entries and not containing:
        raise VariantError(
            f"no variant of a component {component!r}; "
            f"{listing((entry['component'] for entry in _components()), component)}"
        )
    if as_json:
        print_json(entries)
        return
    table = new_table("variant", "inputs", "outputs", "parameters", "description")
    for entry in entries:
        counts = [str(len(entry[key])) for key in ("inputs", "outputs", "parameters")]
        table.add_row(entry["variant"], *counts, entry["description"])
    open_console().print(table)


def _components() -> list[dict[str, Any]]:
    """The catalogue by component: from the sources, else from the installed FMUs."""
    try:
        found: list[dict[str, Any]] = sources("packaging.catalog").overview()
        return found
    except VariantError:
        if places.in_checkout():
            raise
    grouped: dict[str, dict[str, Any]] = {}
    for entry in map(_describe_file, sorted(places.fmus().rglob("*.fmu"))):
        group = grouped.setdefault(
            entry["component"],
            {"component": entry["component"], "description": entry["description"],
             "fidelities": [], "devices": []},
        )  # fmt: skip
        if entry["fidelity"] not in group["fidelities"]:
            group["fidelities"].append(entry["fidelity"])
    return list(grouped.values())


def _variants(component: str, containing: str) -> list[dict[str, Any]]:
    try:
        catalog = sources("packaging.catalog")
    except VariantError:
        if places.in_checkout():
            raise
        found = [_describe_file(path) for path in sorted(places.fmus().rglob("*.fmu"))]
        return [entry for entry in found if _is_of(entry["variant"], component)]
    known = [entry["component"] for entry in catalog.overview()]
    if component and component not in known:
        return []
    with naming_errors():
        names = [*catalog.names(component), *catalog.own_names(component)]
        return [catalog.describe(name) for name in names if containing in name]


def _print_components(entries: list[dict[str, Any]]) -> None:
    table = new_table("component", "fidelities", "devices", "description")
    for entry in entries:
        lists = [", ".join(entry[key]) for key in ("fidelities", "devices")]
        table.add_row(entry["component"], *lists, entry["description"])
    open_console().print(table)
    say("'cosim fmus list COMPONENT' has the variants of one with their inputs and outputs")


def _is_of(variant: str, component: str) -> bool:
    from ..system import variants

    return not component or variants.component(variant) == component


@fmus_app.command("build")
def fmus_build(
    variants: Annotated[
        list[str] | None,
        typer.Argument(help="E.g. gearbox/elastic+backlash, or gearbox for its fidelities [all]."),
    ] = None,
    fmi: Annotated[int, typer.Option(help="FMI version.", min=2, max=3)] = 2,
    kind: Annotated[Kind, typer.Option(help="C code, or the Python twin.")] = Kind.native,
    platform: Annotated[
        Platform, typer.Option(help="This machine, or all five platforms.")
    ] = Platform.host,
    out: Annotated[Path | None, typer.Option(help="Folder; below it fmi2, fmi3, python.")] = None,
    as_json: AsJson = False,
) -> None:
    """Build FMUs of variants.

    Example: `cosim fmus build gearbox/elastic+backlash --fmi 3 --out fmus`
    """
    build_many = sources("packaging.build").build_many
    folder = out or (places.fmus() if places.in_checkout() else Path("fmus"))
    with naming_errors():
        names = _asked(variants or ())
        for name in names if variants else ():  # bad names are found before anything is built
            sources("variant").build_model(name)
    if kind is Kind.python and fmi == 3:
        raise InputError("python FMUs are FMI 2.0 only; drop --fmi 3 or --kind python")
    done = itertools.count(1)
    with naming_errors():
        built = build_many(
            names,
            out=folder,
            fmi=fmi,
            kind=kind.value,
            platform=platform.value,
            progress=lambda name, path: say(f"{next(done)}/{len(names)} {name}: {path}"),
        )
    paths = [{"variant": name, "file": str(path)} for name, path in zip(names, built, strict=True)]
    if as_json:
        print_json({"fmi": fmi, "kind": kind.value, "platform": platform.value, "built": paths})
    else:
        for item in paths:
            typer.echo(item["file"])


def _asked(variants: Sequence[str]) -> list[str]:
    """Names of variants; a component means all of its fidelities, nothing means everything."""
    catalog = sources("packaging.catalog")
    if not variants:
        return list(catalog.names())
    fidelities = {entry["component"]: entry["fidelities"] for entry in catalog.overview()}
    return [
        name
        for asked in variants
        for name in (
            [f"{asked}/{fidelity}" for fidelity in fidelities[asked]]
            if asked in fidelities
            else [asked]
        )
    ]
