"""`cosim diagnose`: from measured data to the name of the missing physics."""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..files import claimed, json_text, write_text
from ..installation.builder import default_provider
from .calibrate import clock_lines
from .guard import heard
from .output import open_console
from .progress import Display
from .signals import taken
from .streams import print_json

if TYPE_CHECKING:
    from rich.console import Console

    from ..calibrate.budget import Budget
    from ..diagnose import Diagnosis
    from ..diagnose.further import Further


def diagnose_command(
    dataset: Annotated[
        Path,
        typer.Argument(metavar="DATASET", help="Folder of logs, or a set of `cosim scenarios`."),
    ],
    system: Annotated[
        str | None, typer.Option(help="Another system than that of the mapping.")
    ] = None,
    mapping: Annotated[
        Path | None,
        typer.Option(help="A dataset.toml, or a name of `cosim scenarios` [by the rig]."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for results [out/DATASET].")] = None,
    law_from_data: Annotated[
        str,
        typer.Option(
            metavar="PLACE",
            help="Make a law from the data at a place, load.flange or arm.joint[2], "
            "and ask no catalogue.",
        ),
    ] = "",
    workers: Annotated[int | None, typer.Option(help="Threads [all cores].")] = None,
    without: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LAW",
            help="Leave an effect out of the catalogue, to test the verdict: data that have it "
            "should end as unexplained, not with a wrong name. Repeatable.",
        ),
    ] = None,
    runs: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Simulated runs at most; what is found until then is reported, "
            "as after Ctrl-C [no limit].",
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON value to stdout.")
    ] = False,
) -> None:
    """Find what a model lacks: calibrate, test, attribute, add the effect, judge on unused runs.

    Example: `cosim diagnose MB-12 --out out/MB-12`
    """
    from ..calibrate.budget import Budget
    from ..calibrate.mapping import read_problem
    from ..diagnose import diagnose
    from ..report.page import write_page

    begun, stage = time.monotonic(), "checking the data"
    with ExitStack() as place:
        with Display() as display:
            provider = default_provider(display.building)
            problem = read_problem(dataset, provider, mapping=mapping, system=system)
            folder = out or Path("out") / problem.name
            place.enter_context(claimed(folder))

            def told(text: str) -> None:
                nonlocal stage
                stage = text
                display.say(f"{time.monotonic() - begun:6.1f} s  {text}")

            budget = Budget(runs)
            with (
                display.watch("diagnosing", lambda: stage if display.on_terminal else ""),
                _ended_by_hand(budget, display.say),
            ):
                result = diagnose(
                    problem, folder, told, workers=workers, without=without or (),
                    law_at=law_from_data, budget=budget,
                )  # fmt: skip
        page, table, models = (folder / n for n in ("report.html", "diagnosis.json", "models.json"))
        result.files += [models, page, table]
        content = result.to_dict()
        try:
            write_page(result, page)
            write_text(table, json_text(content))
            write_text(models, json.dumps(result.table.to_dict(), indent=1) + "\n")
        finally:  # what was found is said, whatever becomes of the files
            if as_json:
                print_json(content)
            else:
                _print(result)


@contextmanager
def _ended_by_hand(budget: Budget, say: Callable[[str], None]) -> Iterator[None]:
    """Ctrl-C or SIGTERM ends the search and reports; a second Ctrl-C ends the program.

    `timeout` sends its signal to the command and to its group, so a second SIGTERM is the first.
    """

    def end() -> None:
        heard()
        if not budget.stopped:
            budget.stop("by hand")
            say("ending: a report on what was found so far follows; Ctrl-C again gives up at once")

    def again() -> None:
        if budget.stopped:
            raise KeyboardInterrupt
        end()

    with taken(signal.SIGINT, again), taken(signal.SIGTERM, end):
        yield


def _print(result: Diagnosis) -> None:
    from rich.table import Table

    from ..calibrate.checks.finding import lines
    from ..diagnose.adding import lines_of
    from ..diagnose.story.verdicts import in_words

    console = open_console(120)
    console.print(f"{result.problem.name}: {result.verdict}. {result.reason}", soft_wrap=True)
    for effect in result.answer.effects():
        values = ", ".join(_value(name, v) for name, v in effect["parameters"].items())
        if held := ", ".join(f"{name} = {value:.4g}" for name, value in effect["held"].items()):
            values += f"; held: {held}"
        console.print(f"  {effect['effect']} at {effect['place']}: {values}", soft_wrap=True)
        if found := effect["other_places"]:
            others = " or ".join(o if " at " in o else f"at {o}" for o in found)
            text = f"    or {others}: these runs do not tell which"
            console.print(text, soft_wrap=True, highlight=False)
    model = result.to_dict()["model"]
    system, mapping = lines_of(model, [e["place"] for e in result.answer.effects()])
    if result.verdict == "effect_found" and not result.adapters and (system or mapping):
        where = "the system file" if system else "dataset.toml"
        console.print(f"  to add it, write in {where}:", soft_wrap=True)
        for line in system or mapping:
            console.print(f"    {line}", soft_wrap=True, markup=False, highlight=False)
    if result.verdict == "confounded":
        console.print(f"  to tell them apart: {in_words(result.experiment)}", soft_wrap=True)
    for hint in result.answer.hints:
        console.print(f"  hint: {hint}; no name, since {'; '.join(hint.why)}", soft_wrap=True)
    # the report has the rest of these
    said = lines(f for f in result.findings if f.severity != "warning")
    for text in [w for w in result.warnings if w not in said]:
        text = text.removeprefix("warning: ")  # as findings begin
        console.print(f"  warning: {text}", soft_wrap=True, markup=False, highlight=False)
    if (law := result.to_dict()["law_from_data"]) is not None:
        _print_law(law, console)
    for text in clock_lines(result.to_dict()["clocks"]):
        console.print(f"  {text}", soft_wrap=True)
    table = Table()
    for head in ("channel", "unit", "noise", "before ident.", "before valid.", "after ident.",
                 "after valid."):  # fmt: skip
        table.add_column(head, no_wrap=True)
    for name, row in result.to_dict()["channels"].items():
        cells = [row["before"]["identification"], row["before"]["validation"],
                 row["after"]["identification"], row["after"]["validation"]]  # fmt: skip
        table.add_row(
            name, row["unit"], f"{row['noise_rms']:.4g}",
            *("-" if value is None else f"{value:.4g}" for value in cells),
        )  # fmt: skip
    console.print(table)
    for item in result.further:
        console.print(_spread(item), soft_wrap=True)
    console.print(f"report: {result.files[-2]}", soft_wrap=True)


def _print_law(law: dict[str, Any], console: Console) -> None:
    """A law made from the data: what it is, what it changes, which named laws are near."""
    if not law["made"]:
        console.print(f"  no law at {law['place']}: {law['reason']}", soft_wrap=True)
        return
    console.print(f"  law at {law['place']}: {law['formula']}", soft_wrap=True)
    for name, row in law["error"].items():
        unused = row["after"]["validation"] is not None
        purpose, runs = ("validation",) * 2 if unused else ("identification", "fitted")
        before, after = (row[which][purpose] for which in ("before", "after"))
        if None not in (before, after):
            console.print(
                f"    {name}: {before:.4g} -> {after:.4g} {row['unit']} on {runs} runs, "
                f"noise {row['noise_rms']:.4g}", soft_wrap=True,
            )  # fmt: skip
    for named in law["nearest"]:
        runs = "fitted" if named["unused_runs_prefer_the_law_by_nats"] is None else "unused"
        console.print(
            f"    near it: {named['effect']}, {named['rms_difference']:.3g} {law['unit']} away "
            f"(RMS), worse by {named[f'{runs}_runs_prefer_the_law_by_nats']:.0f} nats on {runs} "
            "runs", soft_wrap=True,
        )  # fmt: skip


def _spread(further: Further) -> str:
    """How far runs of another system are from the noise, least and most over channels and runs."""
    spans = []
    for which in ("before", "after"):
        sizes = [
            size
            for run in further.problem.runs
            for column in range(len(further.problem.channels))
            if (size := further.rms(which, column, run.name)) is not None
        ]
        spans.append(f"{min(sizes):.2f} to {max(sizes):.2f}" if sizes else "-")
    runs = ", ".join(run.name for run in further.problem.runs)
    return (
        f"{runs} with {further.problem.file.path.stem}, residuals over the noise: "
        f"before {spans[0]}, after {spans[1]}"
    )


def _value(name: str, entry: dict[str, Any]) -> str:
    """A parameter with its interval; open if the data say no more than its bounds."""
    low, high = entry["ci95"]
    tail = "" if entry["identifiable"] else " (open)"
    return f"{name} = {entry['value']:.4g} [{low:.4g}, {high:.4g}] {entry['unit']}{tail}"
