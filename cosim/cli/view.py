"""`cosim view`: a recording in 3D."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import InputError, UnknownNameError, listing
from .output import AsJson, say
from .streams import print_json

if TYPE_CHECKING:
    from ..data.comparison import Reference
    from ..data.recording import Recording


def view_command(
    result: Annotated[
        Path,
        typer.Argument(metavar="RESULT", help="Folder of `cosim run`, recording, or DATASET/RUN."),
    ],
    out: Annotated[
        Path | None, typer.Option(help="Page to write [view.html in the folder].")
    ] = None,
    calibrated: Annotated[
        Path | None, typer.Option(help="calibration.json, for a run of a data set.")
    ] = None,
    show: Annotated[bool, typer.Option("--open", help="Open it in the browser.")] = False,
    as_json: AsJson = False,
) -> None:
    """Show a recording, or a measured run beside its model, in 3D: one page without a server.

    Example: `cosim view out/mobile_manipulator/IY`
    """
    import webbrowser

    from ..view.page import write_view

    recording, references, plots, folder = (
        _measured(result, calibrated) if _set_of(result) else _recorded(result)
    )
    path = write_view(out or folder / "view.html", recording, references, plots=plots)
    if as_json:
        print_json({"recording": str(result), "page": str(path), "bytes": path.stat().st_size})
    else:
        print(path)
    if show:
        webbrowser.open(path.resolve().as_uri())


Shown = tuple["Recording", "list[Reference]", list[str], Path]


def _recorded(result: Path) -> Shown:
    """A recording with what its scenario compares it with."""
    from ..data.recording import read_recording
    from ..scenario import scenario

    file = _recording(result)
    recording = read_recording(file)
    name = str(recording.provenance.get("scenario", ""))
    try:
        source, run = scenario.find(name)
        item = source.scenario(run)
    except InputError:
        say(f"note: scenario {name!r} is not in the library: nothing measured is shown")
        return recording, [], [], file.parent
    plots = [*(item.plot or ()), *(s for axes in item.plots for s in axes.needs)]
    return recording, list(item.references.values()), plots, file.parent


def _set_of(place: Path) -> Path | None:
    """The data set in which a path names a run, None if it is none."""
    files = ("set.toml", "dataset.toml")
    return next((p for p in (place, place.parent) if any((p / f).is_file() for f in files)), None)


def _measured(place: Path, calibrated: Path | None) -> Shown:
    """A run of a data set beside its model."""
    from ..calibrate.mapping import read_problem
    from ..calibrate.replay import replay
    from ..live.reading import read_calibrated

    folder = _set_of(place)
    assert folder is not None
    problem = read_problem(folder)
    if folder == place and len(problem.runs) > 1:
        names = listing(run.name for run in problem.runs)
        raise UnknownNameError(
            f"{place} has {len(problem.runs)} runs; add one to the path: {names}"
        )
    run = problem.runs[0] if folder == place else problem.run(place.name)
    theta = problem.nominal
    for name, value in (read_calibrated(calibrated) if calibrated else {}).items():
        theta[problem.index(name)] = value
    recording, references = replay(problem, theta, run)
    return recording, references, [], Path("out") / problem.name / run.name


def _recording(place: Path) -> Path:
    """The recording that a path means.

    Raises:
        UnknownNameError: there is none, or more than one.
    """
    if place.is_file():
        return place
    kinds = ("recording.parquet", "recording.npz")  # the second where pyarrow is not installed
    for file in (place / kind for kind in kinds):
        if file.is_file():
            return file
    found = sorted(path for kind in kinds for path in place.glob(f"*/{kind}"))
    if len(found) == 1:
        return found[0]
    if found:
        folders = sorted({str(path.parent) for path in found})
        raise UnknownNameError(
            f"{place} has {len(folders)} runs; take one of them: {listing(folders)}"
        )
    raise UnknownNameError(
        f"{place}: there is no recording.parquet; give a folder that `cosim run` has written "
        "(out/motor_bench/ST1 after `cosim run motor_bench`)"
    )
