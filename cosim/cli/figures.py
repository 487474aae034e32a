"""`cosim figures`: the pictures that scenarios choose."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError, listing
from ..files import make_folder
from ..installation.builder import default_provider
from .output import AsJson
from .progress import Display
from .streams import print_json

KINDS = ("png", "svg", "pdf")
"""Of pictures."""


def figures_command(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="SCENARIO...", help="Names or .toml files [all that have figures]."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the pictures.")] = Path("out/figures"),
    kind: Annotated[str, typer.Option("--format", help=f"One of {', '.join(KINDS)}.")] = "png",
    as_json: AsJson = False,
) -> None:
    """Make the figures that scenarios choose: measured beside modelled, paths, torques.

    Example: `cosim figures mobile_manipulator --out out/figures`
    """
    from ..running.figures import figures

    if kind not in KINDS:
        raise InputError(f"--format {kind}: {listing(KINDS, kind)}")
    with Display() as display:
        written = figures(
            names or [],
            default_provider(display.building),
            make_folder(out),
            suffix=kind,
            progress=lambda item, fraction: display.update(item, fraction, 1.0),
        )
    if as_json:
        print_json({"files": [str(path) for path in written]})
        return
    for path in written:
        print(path)
