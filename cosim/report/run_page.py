"""The page of a run: whether it meets its checks, what was recorded, what it is compared with."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..data.comparison import convert_reference
from ..display.document import document, links, section
from ..display.html import Cell, Html, join, number, quantity, table, tag, unit, words
from ..display.plot import Curve, Panel, plot
from ..display.series import Store, stretch
from ..drawing.svg import svg
from ..errors import CosimError
from ..files import write_text
from ..running.runner import Result, RunResult
from ..system.provider import Provider
from .figures import ROOM

Vector = NDArray[np.float64]
TOGETHER = 6
"""Signals of one unit that share a panel."""
OPEN = 6
"""Panels of signals that are not compared with anything and are open from the start."""
MANY = 20
"""Checks from which their table is folded."""
LARGEST = 400_000
"""Bytes of a picture that is taken into the page."""
SHADES = ("after", "before", "other", "fourth", "fifth", "measured")
"""Colours of signals that share a panel."""


@dataclass(frozen=True)
class _Signal:
    """A course of a run that is drawn.

    Attributes:
        key: in the page's store, with the run.
        times, values: the course.
    """

    key: str
    times: Vector
    values: Vector


def write_run_page(result: Result, provider: Provider | None, path: Path) -> Path:
    """Write the page.

    Args:
        result: of the run.
        provider: where variants come from, for the drawing of the system; None leaves it out.
        path: of the page.

    Raises:
        InputError: the file cannot be written.
    """
    write_text(path, run_page(result, provider))
    return path


def run_page(result: Result, provider: Provider | None = None) -> str:
    """The page as HTML; arguments as of `write_run_page`."""
    first = next(iter(result.runs.values()))
    store, thinned = _stored(result)
    names = {run: f"run {run}" if run else "the run" for run in result.runs}
    compared, rest = _compared(result), _others(result)
    plots = [
        plot(panel[0].title, panel, axis="time [s]", cursor="time", group="run", runs=names)
        for panel in [*compared, *([one] for one in rest)]
    ]
    shown = max(len(compared), 1) + OPEN
    whole = result.to_dict()
    about = (
        f"{whole['simulated_s']:g} s simulated in {whole['wall_s']:.2f} s, {whole['algorithm']} "
        f"with {whole['step']:g} s"
    )
    drawn = _drawing(first, provider)
    details = [
        _pictures(result),
        _checks(result),
        section("signals", "All signals", tag("p", _how(thinned)),
                tag("div", *plots[:shown], class_="grid"),
                tag("details", tag("summary", f"{len(plots) - shown} more plots"),
                    tag("div", *plots[shown:], class_="grid")) if plots[shown:] else ""),
        _overview(result), _differences(result), _setup(result, first),
    ]  # fmt: skip
    return document(
        f"Run of {result.name}",
        tag("header", tag("h1", f"Run of {result.name}"), tag("small", about), class_="top"),
        _verdict(result),
        tag("div", tag("div", _about(result, first), class_="cards"),
            tag("section", plots[0] if plots else "", drawn), class_="first"),
        links(details), *details, signals=store,
    )  # fmt: skip


def _verdict(result: Result) -> Html:
    """Whether the checks are met, in a sentence."""
    checks = result.checks
    failed = [name for name, check in checks.items() if check.failed]
    judged = [name for name, check in checks.items() if not check.unfit]
    stopped = [run for run, one in result.runs.items() if one.recording.error]
    if stopped:
        label, kind = "Stopped", "bad_data"
        said = f"It stopped before its end: {result.runs[stopped[0]].recording.error}."
    elif failed:
        label, kind = "Checks failed", "unexplained"
        said = f"{len(failed)} of {len(judged)} checks failed: {'; '.join(failed[:3])}" + (
            "; …" if len(failed) > 3 else "."
        )
    elif judged:
        label, kind = "As expected", "nothing_missing"
        said = f"All {len(judged)} checks are met." if len(judged) > 1 else "Its check is met."
    else:
        label, kind = "Ran to its end", ""
        said = (
            f"None of its {len(checks)} checks is judged: they hold for the declared parts only."
            if checks else "It has no checks."
        )  # fmt: skip
    return tag("div", tag("div", label, class_="label"), tag("p", said, class_="sentence"),
               class_=f"verdict {kind}".strip())  # fmt: skip


def _about(result: Result, first: RunResult) -> Html:
    """Question, expectation, notes."""
    item = first.scenario
    told = [
        tag("p", tag("b", f"{title}: "), text)
        for title, text in (("Question", item.question), ("Expected", item.expected),
                            ("Source", item.source))
        if text
    ]  # fmt: skip
    notes = dict.fromkeys(note for run in result.runs.values() for note in run.notes)
    bonds = any(run.recording.bond_energy for run in result.runs.values())
    invented = sum(run.recording.energy_residual for run in result.runs.values())
    facts = [
        tag("div", tag("b", quantity(invented, "J")), tag("span", "energy that the coupling "
            "invented", class_="what"))
    ] if bonds else []  # fmt: skip
    return tag(
        "section", tag("h2", "What it is about"), tag("p", item.text), *told,
        tag("div", *facts, class_="figures"), *(tag("p", note, class_="note") for note in notes),
        class_="card",
    )  # fmt: skip


def _drawing(run: RunResult, provider: Provider | None) -> Html:
    """The system as it ran."""
    if provider is None:
        return Html("")
    file = replace(run.scenario.system, instances=dict(run.variants), parameters={})
    try:
        drawn = svg(file.build(provider))
    except CosimError as error:  # its files may have gone since
        return tag("p", f"The system is not drawn: {error}", class_="note")
    width = float(drawn.partition('width="')[2].partition('"')[0])
    return join(
        tag("h2", "The system"),
        tag(
            "div", Html(drawn), class_="drawing", tabindex="0", style=f"--least:{0.6 * width:.0f}px"
        ),
    )


def _pictures(result: Result) -> Html:
    """Overview of many runs, or paths over the floor: what is not a course over time."""
    paths = any(axes.paths for run in result.runs.values() for axes in run.scenario.plots)
    files = [path for path in result.files if path.name == "overview.png"]
    if not files and paths:
        files = [path for path in result.files if path.name == "plot.png"][:1]
    shown = [
        tag("img", src=f"data:image/png;base64,{b64encode(path.read_bytes()).decode('ascii')}",
            alt=f"{path.stem} of {result.name}", style="max-width:100%;background:#fff")
        for path in files if path.is_file() and path.stat().st_size <= LARGEST
    ]  # fmt: skip
    return section("overview-picture", "At a glance", *shown)


# -- signals ---------------------------------------------------------------------------------------


def _courses(run: str, result: RunResult) -> list[_Signal]:
    """What is drawn of a run: signals, references, differences."""
    recording = result.recording
    found = [
        _Signal(f"{run}/{name}", recording.time, recording.values[:, column])
        for column, name in enumerate(recording.names)
        if recording.objects.get(name, recording.time).dtype != object
    ]
    for name, reference in result.scenario.references.items():  # a signal may have several
        if len(reference.signals) == 1:
            values = convert_reference(recording, reference)[:, 0]
            found.append(_Signal(f"{run}/{name}/log", reference.times, values))
    for name, item in result.comparisons.items():
        found.append(_Signal(f"{run}/{name}/rest", item.times, item.differences))
    return found


def _stored(result: Result) -> tuple[Store, int]:
    """Everything that is drawn, and how many samples are drawn as one."""
    courses = [item for run, one in result.runs.items() for item in _courses(run, one)]
    samples = sum(item.values.size for item in courses)
    size = stretch(samples, ROOM, max((item.values.size for item in courses), default=1))
    store = Store()
    for item in courses:
        store.put_axis(f"{item.key}/time", item.times, size)
        store.put(item.key, item.values, size)
    return store, size


def _how(size: int) -> str:
    tail = (
        f" {size} samples are drawn as one bar from the smallest to the largest, so that no peak "
        "is lost." if size > 1 else " Every sample is drawn."
    )  # fmt: skip
    return "All plots follow the one that is zoomed." + tail


def _curve(name: str, key: str, colour: str, width: float = 1.4) -> Curve:
    return Curve(name, colour, f"{{run}}/{key}/time", f"{{run}}/{key}", width=width)


def _in(of: str) -> str:
    return f" [{unit(of)}]" if unit(of) else ""


def _compared(result: Result) -> list[list[Panel]]:
    """A plot for each comparison: reference and model, and their difference below."""
    found: dict[str, list[Panel]] = {}
    for run in result.runs.values():
        for name, item in run.comparisons.items():
            if name in found:
                continue
            reference, of = run.scenario.references[name], _in(item.unit)
            rest = Panel(
                f"{name}: simulated − {item.reference}{of}",
                [_curve("difference", f"{name}/rest", "before")],
                None,
                110,
                "difference",
            )
            found[name] = [rest]
            if len(reference.signals) == 1:
                signal = reference.signals[0]
                curves = [
                    _curve("reference", f"{name}/log", "measured", 2.2),
                    _curve("model", signal, "after"),
                ]
                found[name].insert(0, Panel(f"{signal}{of}", curves, None, 190, name))
    return list(found.values())


def _others(result: Result) -> list[Panel]:
    """Signals that are compared with nothing, those of one unit together."""
    shown = {
        reference.signals[0]
        for run in result.runs.values() for reference in run.scenario.references.values()
        if len(reference.signals) == 1
    }  # fmt: skip
    groups: dict[str, list[str]] = {}
    for run in result.runs.values():
        recording = run.recording
        for name in recording.names:
            own = groups.setdefault(recording.units.get(name, ""), [])
            plain = recording.objects.get(name, recording.time).dtype != object
            if name not in shown and name not in own and plain:
                own.append(name)
    panels = []
    for of, names in groups.items():
        for begin in range(0, len(names), TOGETHER):
            part = names[begin : begin + TOGETHER]
            curves = [_curve(n, n, c) for n, c in zip(part, SHADES, strict=False)]
            title = part[0] if len(part) == 1 else f"{part[0]} and {len(part) - 1} more"
            panels.append(Panel(title + _in(of), curves, None, 170, of))
    return panels


# -- tables ----------------------------------------------------------------------------------------


def _checks(result: Result) -> Html:
    rows = []
    for name, check in result.checks.items():
        limit = check.limit if isinstance(check.limit, list) else [check.limit]
        outcome = "not judged" if check.unfit else "ok" if check.ok else "FAILED"
        kind = "over" if check.failed else "" if check.unfit else "good"
        rows.append(
            [name, check.value, Cell(" to ".join(map(number, limit)), limit[-1]),
             unit(check.unit), Cell(outcome, kind=kind),
             Cell(check.unfit or check.source, kind="text")]
        )  # fmt: skip
    found = table(["check", "value", "limit", "unit", "", "why this limit"], rows, "checks")
    if len(rows) > MANY:
        found = tag("details", tag("summary", f"{len(rows)} checks"), found)
    return section("checks", "Checks", found)


def _overview(result: Result) -> Html:
    if len(result.runs) < 2:
        return Html("")
    parts = []
    for item in result.overview:
        head, rows = item.rows()
        parts.append(table(head, [list(row) for row in rows], item.name))
    return section("overview", "Runs side by side", *parts)


def _differences(result: Result) -> Html:
    rows: list[Sequence[object]] = [
        [run or "–", name, Cell(number(item.rms), item.rms), Cell(number(item.max), item.max),
         unit(item.unit), Cell(str(item.count), float(item.count)), Cell(item.reference,
                                                                         kind="text")]
        for run, one in result.runs.items() for name, item in one.comparisons.items()
    ]  # fmt: skip
    head = ["run", "compared", ("RMS", "Root mean square of the differences."),
            ("largest", "Largest magnitude of the differences."), "unit", "samples",
            "with"]  # fmt: skip
    return section("differences", "Differences", table(head, rows, "differences"))


def _setup(result: Result, first: RunResult) -> Html:
    rows = [[tag("code", name), Cell(tag("code", variant), kind="text")]
            for name, variant in first.variants.items()]  # fmt: skip
    files = [tag("code", path.name) for path in result.files]
    return section(
        "setup", "What ran", table(["instance", "variant"], rows, "variants"),
        tag("p", "Files beside this page: ", words(list(dict.fromkeys(files))), ".")
        if files else "",
    )  # fmt: skip
