"""`cosim view`: a recording in 3D."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError, UnknownNameError, listing
from .output import AsJson, say
from .streams import print_json


def view_command(
    result: Annotated[
        Path, typer.Argument(metavar="RESULT", help="Folder that `cosim run` wrote, or recording.")
    ],
    out: Annotated[
        Path | None, typer.Option(help="Page to write [view.html beside the recording].")
    ] = None,
    show: Annotated[bool, typer.Option("--open", help="Open it in the browser.")] = False,
    as_json: AsJson = False,
) -> None:
    """Show a recording in 3D: one page that needs no server and no network.

    Example: `cosim view out/mobile_manipulator/IY`
    """
    import webbrowser

    from ..data.recording import read_recording
    from ..scenario import scenario
    from ..view.page import write_view

    file = _recording(result)
    recording = read_recording(file)
    name = str(recording.provenance.get("scenario", ""))
    references, plots = [], []
    try:
        source, run = scenario.find(name)
        item = source.scenario(run)
    except InputError:
        say(f"note: scenario {name!r} is not in the library: nothing measured is shown")
    else:
        references = list(item.references.values())
        plots = [*(item.plot or ()), *(s for axes in item.plots for s in axes.needs)]
    path = write_view(out or file.with_name("view.html"), recording, references, plots=plots)
    if as_json:
        print_json({"recording": str(file), "page": str(path), "bytes": path.stat().st_size})
    else:
        print(path)
    if show:
        webbrowser.open(path.resolve().as_uri())


def _recording(place: Path) -> Path:
    """The recording that a path means.

    Raises:
        UnknownNameError: there is none, or more than one.
    """
    if place.is_file():
        return place
    file = place / "recording.parquet"
    if file.is_file():
        return file
    found = sorted(path.parent for path in place.glob("*/recording.parquet"))
    if len(found) == 1:
        return found[0] / "recording.parquet"
    if found:
        raise UnknownNameError(
            f"{place} has {len(found)} runs; take one of them: {listing(map(str, found))}"
        )
    raise UnknownNameError(
        f"{place}: there is no recording.parquet; give the folder that 'cosim run' wrote"
    )
