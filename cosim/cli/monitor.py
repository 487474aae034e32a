"""`cosim monitor`: what has changed over many logs of one machine, since when."""

from __future__ import annotations

import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..files import claimed, json_text, write_text
from ..installation.builder import default_provider
from .output import open_console
from .progress import Display
from .streams import print_json

if TYPE_CHECKING:
    from ..monitor import Monitored

SHOWN = 12
"""Charts that are printed: those with logs beyond their limits first."""


def monitor_command(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER", help="A data set whose runs have dates, or a folder of data sets."
        ),
    ],
    system: Annotated[
        str | None, typer.Option(help="Another system than that of the mapping.")
    ] = None,
    mapping: Annotated[
        Path | None,
        typer.Option(help="A dataset.toml, or a name of `cosim scenarios` [by the rig]."),
    ] = None,
    baseline: Annotated[
        int | None,
        typer.Option(
            help="First logs that parameters and limits are taken from [10, or half of all]."
        ),
    ] = None,
    rate: Annotated[
        float, typer.Option(help="Probability of any alarm on a series in which nothing changes.")
    ] = 0.001,
    out: Annotated[Path | None, typer.Option(help="Folder for results [out/FOLDER].")] = None,
    workers: Annotated[int | None, typer.Option(help="Threads [all cores].")] = None,
    without: Annotated[
        list[str] | None,
        typer.Option(metavar="LAW", help="Leave an effect out of the catalogue. Repeatable."),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON value to stdout.")
    ] = False,
) -> None:
    """Follow parameters over a series of logs: what has changed, since when, and what it is.

    Example: `cosim monitor logs/bench_3 --out out/bench_3`
    """
    from ..monitor import monitor, read_series
    from ..report.monitor import write_monitor_page

    begun, stage = time.monotonic(), "reading the logs"
    with ExitStack() as place:
        with Display() as display:
            provider = default_provider(display.building)

            def told(text: str) -> None:
                nonlocal stage
                stage = text

            def look() -> str:
                return f"{time.monotonic() - begun:6.1f} s  {stage}"

            with display.watch("monitoring", look):
                series = read_series(folder, provider, mapping=mapping, system=system)
                results = out or Path("out") / series.name
                place.enter_context(claimed(results))
                result = monitor(
                    series, told, baseline=baseline, rate=rate, workers=workers,
                    without=without or (),
                )  # fmt: skip
        page, table = results / "report.html", results / "monitor.json"
        content = result.to_dict() | {"files": [str(table), str(page)]}
        try:
            write_text(table, json_text(content))
            write_monitor_page(result, page)
        finally:  # what was found is said, whatever becomes of the files
            if as_json:
                print_json(content)
            else:
                _print(result, page)


def _print(result: Monitored, page: Path) -> None:
    from rich.table import Table

    from ..monitor.result import VERDICTS

    console = open_console(120)
    console.print(
        f"{result.series.name}: {VERDICTS[result.verdict].lower()}. {result.span}, "
        f"by the {result.series.dated}",
        soft_wrap=True, markup=False, highlight=False,
    )  # fmt: skip
    for change in result.changes:
        console.print(f"  {result.sentence(change)}", soft_wrap=True, markup=False, highlight=False)
    table = Table()
    for head in ("quantity", "unit", "first logs", "limits", "last log", "beyond limits"):
        table.add_column(head, no_wrap=True)
    charts = result.charts()
    shown = sorted(charts, key=lambda chart: not chart.outside)[:SHOWN]
    for chart in (c for c in charts if any(c is one for one in shown)):
        beyond = "-"
        if chart.outside:
            beyond = f"{len(chart.outside)}, first {result.dated(chart.outside[0])}"
        table.add_row(
            chart.name, "" if chart.unit in ("1", "-") else chart.unit, f"{chart.centre:.4g}",
            f"{chart.low:.4g} to {chart.high:.4g}", f"{chart.values[-1]:.4g}", beyond,
        )  # fmt: skip
    console.print(table)
    for text in result.warnings:
        console.print(f"warning: {text}", soft_wrap=True, markup=False, highlight=False)
    console.print(
        f"Of series in which nothing changes, {result.rate:g} alarm; {result.found.tests} tests.",
        soft_wrap=True, highlight=False,
    )  # fmt: skip
    console.print(f"report: {page}", soft_wrap=True)
