"""`cosim study`: a scenario over variants, parameters, algorithms and steps, in parallel."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError, StudyError
from ..installation.builder import default_provider
from ..system.provider import FolderProvider, Provider
from .output import open_console
from .progress import Display
from .streams import print_json

if TYPE_CHECKING:
    from ..study import StudyResult

SHOWN = 40
"""Runs that are printed one by one; of more, each variant gets a row."""
SHOWN_FAILURES = 5
SHOWN_INDICES = 8
"""Results whose indices are printed, as many as are drawn."""


def study_command(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="A study file (.toml), or the name of one.")
    ],
    out: Annotated[
        Path | None, typer.Option(help="Folder for results; what is there is kept [out/FILE].")
    ] = None,
    workers: Annotated[int | None, typer.Option(help="Threads [one per core].")] = None,
    scheduler: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Run on the workers of a dask scheduler.")
    ] = "",
    retry: Annotated[bool, typer.Option("--retry", help="Make failed runs again.")] = False,
    fmus: Annotated[
        Path | None, typer.Option(help="Take variants from this folder instead of building.")
    ] = None,
    isolate: Annotated[
        bool, typer.Option("--isolate", help="Each run in a process of its own: FMUs may crash.")
    ] = False,
    time_limit: Annotated[
        float, typer.Option(help="With --isolate: longest time of one call to an FMU [s].")
    ] = 60.0,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON value to stdout.")
    ] = False,
) -> None:
    """Run a scenario over variants, parameters, algorithms and steps; go on where it stopped.

    Example: `cosim study motor_bench --out out/swap`, or `cosim study my/study.toml`
    """
    from ..study import Progress as State
    from ..study import read_study, run_study

    if fmus is not None and not fmus.is_dir():
        raise InputError(f"--fmus {fmus}: there is no such folder")
    study = read_study(file)
    folder = out or Path("out") / study.name
    last = State(0, 0, 0)
    try:
        with Display() as display:

            def told(state: State) -> None:
                nonlocal last
                last = state
                failed = f", {state.failed} failed" if state.failed else ""
                count = f"{state.done} of {state.total} runs{failed}"
                display.update(study.name, state.done, state.total, count=count)

            provider: Provider = (
                FolderProvider(fmus) if fmus is not None else default_provider(display.building)
            )
            result = run_study(
                study, out=folder, workers=workers, scheduler=scheduler, retry=retry,
                provider=provider, isolate=time_limit if isolate else None, progress=told,
                warn=lambda text: display.say(f"warning: {text}"),
            )  # fmt: skip
    except KeyboardInterrupt:
        if not last.total:
            raise  # nothing was run
        text = f"interrupted: {last.done} of {last.total} runs are done and kept in {folder}"
        typer.echo(f"{text}; the same command goes on from there", err=True)
        raise SystemExit(130) from None
    for note in result.notes:
        typer.echo(f"note: {note}", err=True)
    if as_json:
        print_json(result.to_dict())
    else:
        _print(result)
    failures = result.failures
    if failures:
        error = StudyError(
            f"{len(failures)} of {len(result.table.rows)} runs failed; the others are done. "
            "Failures are kept like results; --retry makes them again"
        )
        for row in failures[:SHOWN_FAILURES]:
            error.add_note(f"  {_made_with(row, result)}: {row['error'].splitlines()[0]}")
        if len(failures) > SHOWN_FAILURES:
            error.add_note(f"  and {len(failures) - SHOWN_FAILURES} more, in {result.files[0]}")
        raise error


def _made_with(row: dict[str, Any], result: StudyResult) -> str:
    names = result.table.varied
    parts = [f"{_head(name)}={_text(row[name])}" for name in names if row.get(name) is not None]
    return ", ".join(parts) or str(row["scenario"])


def _print(result: StudyResult) -> None:
    from rich.table import Table

    console = open_console(200)
    table, rows = result.table, result.table.rows
    corrupt = f", {len(result.corrupt)} unusable files set aside" if result.corrupt else ""
    console.print(
        f"{result.study.name}: {len(rows)} runs, {result.computed} made now, {result.reused} were "
        f"there, {len(result.failures)} failed{corrupt}, {result.wall_s:.1f} s",
        soft_wrap=True,
    )
    cost = ["wall", "fmu_steps", "x_real_time"]
    if len(rows) <= SHOWN:
        role = ["role"] if any(row["role"] for row in rows) else []
        names = [*table.varied, *role, *table.errors, *cost]
        shown = rows
    else:
        shown = table.variants()
        keys = [name for name in table.varied if not name.startswith("param.")]
        errors = [item for name in table.errors for item in (name, f"worst.{name}")]
        names = [*keys, "runs", "failed", *errors, *cost]
        console.print("medians over the runs of each variant; every run is in study.csv")
    units = {**table.units, **{f"worst.{name}": unit for name, unit in table.units.items()}}
    printed = Table()
    for name in names:
        unit = f" [{units[name]}]" if units.get(name) else ""
        printed.add_column(_head(name) + unit, no_wrap=name in table.varied)
    for row in shown:
        if row.get("status", "ok") == "ok":
            printed.add_row(*(_text(row.get(name)) for name in names))
        else:
            made = [_text(row.get(name)) for name in table.varied]
            printed.add_row(*made, "FAILED")  # the errors follow on stderr
    console.print(printed)
    for item in result.sensitivities[:SHOWN_INDICES]:
        console.print(item.sentence(), soft_wrap=True)
    if len(result.sensitivities) > SHOWN_INDICES:
        left = len(result.sensitivities) - SHOWN_INDICES
        console.print(f"indices of {left} more results are in sensitivity.csv")
    for path in result.files:
        console.print(str(path), soft_wrap=True)


def _head(name: str) -> str:
    """A column without its kind, where that can be seen from its values."""
    return name.removeprefix("set.").removeprefix("param.").replace("x_real_time", "× real time")


def _text(value: Any) -> str:
    if value is None or value == "":
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
