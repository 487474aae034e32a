"""`cosim data`: what is in a log, and a mapping made from it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import InputError
from .output import AsJson, new_table, open_console, say
from .streams import print_json

if TYPE_CHECKING:
    from rich.console import Console

    from ..intake.inspect import ColumnReport, FileReport, TopicReport

data_app = typer.Typer(help="Logs: what is in them, and how they map to a system.",
                       no_args_is_help=True)  # fmt: skip

Files = Annotated[
    list[Path], typer.Argument(metavar="FILE...", help="Logs: tables, bags, MCAP, MATLAB, ulog.")
]
Topics = Annotated[
    list[str] | None, typer.Option("--topic", help="Of a bag: only this topic (again for more).")
]
SMOOTH = 0.2
"""Steps of resolution below which noise is none: rounding alone makes 0.29 of one."""
PICTURES = (".png", ".svg", ".pdf")


@data_app.command("inspect")
def inspect_command(
    files: Files,
    topics: Topics = None,
    plot: Annotated[Path | None, typer.Option(help="Draw it: a .png, .svg or .pdf file.")] = None,
    as_json: AsJson = False,
) -> None:
    """Say what is in logs: columns, units, clocks, gaps, and what is odd.

    Example: `cosim data inspect log.csv --plot log.png`
    """
    from ..intake.inspect import inspect
    from ..intake.picture import draw

    if plot is not None and plot.suffix.lower() not in PICTURES:
        raise InputError(f"--plot {plot}: pictures are {', '.join(PICTURES)} files")
    reports = [inspect(path, topics or ()) for path in files]
    made = []
    if plot is not None:
        path, left = draw(reports, plot)
        made.append(str(path))
        if left:
            say(f"note: no room in the picture for {', '.join(left)}")
    if as_json:
        print_json({"files": [report.to_dict() for report in reports], "pictures": made})
        return
    console = open_console()
    for report in reports:
        _print(console, report)
        for topic in report.topics:
            for found in topic.findings:
                column = f"{found.column}: " if found.column else ""
                console.print(f"  {found.severity}: {column}{found.text}", soft_wrap=True,
                              markup=False, highlight=False)  # fmt: skip
    for name in made:
        console.print(f"picture: {name}", soft_wrap=True, markup=False)


def _print(console: Console, report: FileReport) -> None:
    for topic in report.topics:
        name = report.source.path.name
        if not report.source.plain:
            name += f" {topic.topic.name}"
        console.print(f"{name} ({topic.topic.kind}): {clock_line(topic)}", soft_wrap=True,
                      markup=False, highlight=False)  # fmt: skip
        if topic.topic.frames:
            console.print(f"  frames: {topic.topic.frames}", markup=False, highlight=False)
        table = new_table("column", "unit", "why", "min", "max", "resolution", "noise", "missing")
        for column in topic.columns:
            table.add_row(*_row(column))
        console.print(table)
    for name, why in report.source.left.items():
        console.print(f"  left out: {name}: {why}", soft_wrap=True, markup=False, highlight=False)


def _row(column: ColumnReport) -> list[str]:
    from rich.markup import escape

    unit = column.unit.unit or "?"
    noise = f"{column.noise:.3g}" if column.noise > SMOOTH * column.resolution else "-"
    return [
        escape(column.name), unit if column.unit.sure or unit == "?" else f"{unit} (guessed)",
        escape(column.unit.reason), f"{column.low:.5g}", f"{column.high:.5g}",
        f"{column.resolution:.3g}", noise,
        str(column.missing) if column.missing else "-",
    ]  # fmt: skip


def clock_line(topic: TopicReport) -> str:
    """Rate, duration and clock of a topic in one line."""
    clock, log = topic.clock, topic.topic.log
    rows = next((len(values) for values in log.columns.values()), 0)
    if not clock.column:
        return f"{rows} rows, no clock"
    rate = f"{1.0 / clock.interval:.4g} Hz" if clock.interval > 0.0 else "one row"
    began = f", from {clock.began()}" if clock.began() else ""
    unit = clock.unit.unit or "unknown unit"
    return (
        f"{rows} rows, {rate} for {clock.duration:.4g} s (jitter {clock.jitter:.1%}), clock "
        f"{clock.column} in {unit}: {clock.unit.reason}{began}"
    )
