"""The commands of `cosim fmus`: the catalogue, and building."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import InputError, VariantError, listing
from ..files import atomic, make_folder
from ..installation import places
from ..installation.builder import carried, components, naming_errors, sources
from ..installation.library import Library
from .check import check_command
from .output import AsJson, new_table, open_console, say
from .progress import Display
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
        _print_components(components())
        return
    entries = [
        entry for entry in _variants(component, containing) if containing in entry["variant"]
    ]
    if component and not entries and not containing:
        raise VariantError(
            f"no variant of a component {component!r}; "
            f"{listing((entry['component'] for entry in components()), component)}"
        )
    if as_json:
        print_json(entries)
        return
    table = new_table("variant", "inputs", "outputs", "parameters", "description")
    for entry in entries:
        counts = [str(len(entry[key])) for key in ("inputs", "outputs", "parameters")]
        table.add_row(entry["variant"], *counts, entry["description"])
    open_console().print(table)


def _variants(component: str, containing: str) -> list[dict[str, Any]]:
    library = carried()
    if library is not None:
        return [
            entry
            for entry in library.variants()
            if component in ("", entry["component"]) and containing in entry["variant"]
        ]
    catalog = sources("packaging.catalog")
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
    folder = out or (places.fmus() if places.in_checkout() else Path("fmus"))
    if kind is Kind.python and fmi == 3:
        raise InputError("python FMUs are FMI 2.0 only; drop --fmi 3 or --kind python")
    if kind is Kind.native and platform is Platform.host and (library := carried()) is not None:
        paths = _copied(library, variants or (), fmi, folder)
    else:
        paths = _compiled(variants or (), fmi, kind, platform, folder)
    if as_json:
        built = [{"variant": name, "file": str(path)} for name, path in paths.items()]
        print_json({"fmi": fmi, "kind": kind.value, "platform": platform.value, "built": built})
    else:
        for path in paths.values():
            typer.echo(str(path))


def _compiled(
    variants: Sequence[str], fmi: int, kind: Kind, platform: Platform, folder: Path
) -> dict[str, Path]:
    """FMUs made from the sources."""
    build_many = sources("packaging.build").build_many
    with naming_errors():
        names = _asked(variants)
        for name in names if variants else ():  # bad names are found before anything is built
            sources("variant").build_model(name)
    done: list[str] = []
    begun, where = time.monotonic(), " for all platforms" if platform is Platform.all else ""

    def look() -> str:  # the first one for all platforms brings their C libraries: minutes
        after = 20 * int((time.monotonic() - begun) / 20.0)
        told = f" after {after} s" if after else ""
        return f"building: {len(done)} of {len(names)} FMUs{where}{told}"

    with naming_errors(), Display() as display, display.watch("building", look):
        built = build_many(
            names,
            out=folder,
            fmi=fmi,
            kind=kind.value,
            platform=platform.value,
            progress=lambda name, path: done.append(name),
        )
    return dict(zip(names, built, strict=True))


def _copied(library: Library, variants: Sequence[str], fmi: int, folder: Path) -> dict[str, Path]:
    """FMUs that an installed wheel carries, those that it lacks made from the sources."""
    fidelities = {entry["component"]: entry["fidelities"] for entry in library.components()}
    names = _spread(variants, fidelities) if variants else list(library.names())
    found = {name: library.find(name, fmi) for name in names}
    paths: dict[str, Path] = {}
    for name, path in found.items():
        if path is None:
            paths |= _compiled([name], fmi, Kind.native, Platform.host, folder)
            continue
        target = make_folder(folder / f"fmi{fmi}") / path.name
        with atomic(target) as temporary:
            temporary.write_bytes(path.read_bytes())
        paths[name] = target
    return paths


def _asked(variants: Sequence[str]) -> list[str]:
    """Names of variants; a component means all of its fidelities, nothing means everything."""
    catalog = sources("packaging.catalog")
    if not variants:
        return list(catalog.names())
    return _spread(variants, {item["component"]: item["fidelities"] for item in catalog.overview()})


def _spread(variants: Sequence[str], fidelities: Mapping[str, Sequence[str]]) -> list[str]:
    """Names of variants, those of all fidelities for a component's name."""
    found = []
    for asked in variants:
        if asked not in fidelities and "/" not in asked:
            raise VariantError(
                f"there is no component {asked!r}; {listing(fidelities, asked)}, or write "
                "component/fidelity"
            )
        found += [f"{asked}/{f}" for f in fidelities[asked]] if asked in fidelities else [asked]
    return found
