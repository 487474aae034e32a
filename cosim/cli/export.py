"""`cosim export` and `cosim draw`: a scenario's system as SSP archive or picture."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import InputError
from ..files import write_text
from ..installation.builder import default_provider
from .progress import Display

if TYPE_CHECKING:
    from ..scenario.scenario import Scenario

Name = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="Name, folder or .toml file, with /RUN.")
]


def _only(name: str) -> Scenario:
    from ..scenario import scenario as scenarios

    file, wanted = scenarios.find(name)
    if not wanted and len(file.runs) > 1:
        raise InputError(
            f"{name} has {len(file.runs)} runs; name one, e.g. {name}/{next(iter(file.runs))}"
        )
    return file.scenario(wanted or next(iter(file.runs)))


def export_command(
    name: Name,
    ssp: Annotated[Path, typer.Option(help="The .ssp file to write.")],
    ssp_version: Annotated[str, typer.Option(help="1.0 or 2.0.")] = "1.0",
) -> None:
    """Write a scenario's system, inputs and FMUs as an SSP archive for other tools.

    Example: `cosim export mobile_manipulator/IY --ssp iy.ssp`
    """
    from ..ssp import export, local_starts, read

    if ssp_version not in ("1.0", "2.0"):
        raise InputError(f"--ssp-version {ssp_version}: must be 1.0 or 2.0")
    with Display() as display:
        path = export(_only(name), ssp, default_provider(display.building), version=ssp_version)
    if names := local_starts(read(path)):
        typer.echo(f"note: libcosim sets no local variables: {', '.join(names)}", err=True)
    print(path)


def draw_command(
    name: Name, out: Annotated[Path, typer.Option(help="The .svg file to write.")]
) -> None:
    """Draw a scenario's system as SVG.

    Example: `cosim draw mobile_manipulator/IY --out iy.svg`
    """
    from ..system.variants import apply

    with Display() as display:
        item, provider = _only(name), default_provider(display.building)
        instances = apply(item.system.instances, item.variants, provider, item.folder)
        system = replace(item.system, instances=instances).build(provider, item.parameters)
    write_text(out, system.svg())
    print(out)
