"""A draft of a mapping from matched columns: units, clocks, noise, runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..data.segments import ROUNDING
from ..errors import InputError, UnknownNameError, listing
from ..spec.units import conversion, parse
from .draft import ColumnEntry, Draft, Entry
from .files import clock_column, known_clock, readable
from .grouping import plain
from .guess import is_angle, turn_of
from .inspect import ColumnReport
from .matching import Column, Match, Matches
from .rules.lost import lost
from .runs import Part, Run
from .words import COMMAND, pieces, words

LATE, SHARE = 1.0, 0.1
"""[s] Most by which a clock of another topic is thought to be late, and the share of the shortest
run that this may be."""
SHORT_TAIL = 5.0
"""Intervals of a command topic by which a run may go on after its last command."""
MEASURED = ("measured", "odom", "odometry", "estimate", "estimated", "filtered", "imu")
"""Words in the names of topics of twists that are no commands."""
GUESSED = 1e-3
"""Noise of a column that has none, over its range."""


@dataclass(frozen=True)
class Layout:
    """How the runs' parts are read.

    Attributes:
        whole: whether files are read as they are; else each part is a file of its own.
        main: key of the part whose clock counts.
        command: keys of the parts that hold inputs.
        late: [s] bound on the lateness of other clocks.
        window: [s] of the pieces that runs are cut into, 0 for whole runs.
        lateness: [s] of clocks, where it is known, by key of the part.
    """

    whole: bool
    main: str
    command: tuple[str, ...]
    late: float
    window: float = 0.0
    lateness: Mapping[str, float] = field(default_factory=dict)

    def behind(self, key: str) -> float:
        """How late the clock of a part is against the main one [s], as far as it is known."""
        return self.lateness.get(key, 0.0) - self.lateness.get(self.main, 0.0)


def columns_of(runs: Sequence[Run]) -> list[Column]:
    """Columns that all runs have, with the unit that the first run in which they move shows."""
    found = []
    first = runs[0]
    for key, part in first.parts.items():
        spoken = [*words(key), *words(part.report.topic.name), *words(part.report.topic.kind)]
        said = COMMAND in spoken or ("twist" in spoken and not set(MEASURED) & set(spoken))
        for column in part.report.columns:
            reports = [_report(run, key, column.name) for run in runs]
            if any(report is None for report in reports):
                continue
            known = [r for r in reports if r is not None]
            moving = [r for r in known if r.high > r.low]
            unit = next((r.unit for r in moving if r.unit.unit), column.unit)
            found.append(Column(key, column.name, unit, bool(moving), said))
    return found


def _report(run: Run, key: str, name: str) -> ColumnReport | None:
    columns = run.parts[key].report.columns if key in run.parts else ()
    return next((c for c in columns if c.name == name), None)


def layout(
    runs: Sequence[Run],
    matches: Matches,
    window: float = 0.0,
    lateness: Mapping[str, float] | None = None,
) -> Layout:
    """How the parts are read: the clock of the part that measures most is the main one.

    Args:
        runs: with the parts that are used.
        matches: which columns they are for.
        window: [s] of the pieces that runs are cut into, 0 for whole runs.
        lateness: [s] of clocks, where it is known, by key of the part.

    Raises:
        UnknownNameError: the lateness of a part that is not used.
        InputError: a run is shorter than a piece.
    """
    for key in lateness or {}:
        if key not in runs[0].parts:
            raise UnknownNameError(
                f"--late {key}: no part of the runs is called so; "
                f"{listing([k for k in runs[0].parts if k], key)}"
            )
    count: dict[str, int] = {}
    for match in matches.channels.values():
        count[match.column.part] = count.get(match.column.part, 0) + 1
    main = max(count, key=lambda key: (count[key], _rate(runs[0].parts[key])))
    lengths = {run.name: run.parts[main].report.clock.duration for run in runs}
    shortest = min(lengths.values())
    least = window * (1.0 - ROUNDING)
    if shortest < least:
        short = ", ".join(f"{name} {of:.4g} s" for name, of in lengths.items() if of < least)
        raise InputError(
            f"--window {window:g}: these runs last less: {short}; leave them out, or take another"
        )
    shortest = min(shortest, window or shortest)
    used = {m.column.part for m in (*matches.inputs.values(), *matches.channels.values())}
    whole = all(readable([run.parts[key] for key in used]) for run in runs)
    inputs = tuple(dict.fromkeys(m.column.part for m in matches.inputs.values()))
    return Layout(whole, main, inputs, min(LATE, SHARE * shortest), window, dict(lateness or {}))


def _rate(part: Part) -> float:
    interval = part.report.clock.interval
    return 1.0 / interval if interval > 0.0 else 0.0


def draft_of(
    runs: Sequence[Run], matches: Matches, files: Mapping[str, Mapping[str, str]],
    plan: Layout, system: str,
    head: str,
) -> Draft:  # fmt: skip
    """The draft, without what is told by simulating: start values, step, parameters."""
    first = runs[0].parts
    clock = clock_column(first[plan.main], plan.whole)
    draft = Draft(
        head, system, step=_nice(first[plan.main].report.clock.interval),
        time=f"{plan.main}.{clock}" if plan.main else clock,
        constants=dict(matches.constants),
    )  # fmt: skip
    draft.period = draft.step
    _clocks(draft, runs, plan)
    names: dict[str, str] = {}
    for match in (*matches.inputs.values(), *matches.channels.values()):
        if match.column.source not in names:
            names[match.column.source] = name = _name(match.column, set(names.values()))
            draft.columns.append(
                _column(name, match, runs, plan, match.place.name in matches.inputs)
            )
    for variable, match in matches.inputs.items():
        draft.inputs[variable] = names[match.column.source]
    late: dict[str, list[str]] = {}
    for variable, match in matches.channels.items():
        name = names[match.column.source]
        draft.channels[name] = _channel(variable, match, runs)
        known = match.column.part in plan.lateness
        if plan.command and match.column.part not in plan.command and not known:
            late.setdefault(match.column.part, []).append(name)
    for key, channels in late.items():
        draft.nuisances.append(_clock_nuisance(key, channels, plan))
    for run in runs:
        draft.runs.append(_run(run, files[run.name], plan))
    return draft


def _nice(value: float) -> float:
    """Three digits of a number."""
    return float(f"{value:.3g}")


def _clocks(draft: Draft, runs: Sequence[Run], plan: Layout) -> None:
    """What is said about the main clock, and its unit where the mapping must be told."""
    part = runs[0].parts[plan.main]
    clock = part.report.clock
    if plan.main:
        draft.time_comment = (
            f"Samples are those of {plan.main}; the other parts keep their own clocks."
        )
    if plan.whole and not known_clock(part) and clock.unit.unit not in ("s", ""):
        draft.columns.append(
            ColumnEntry(
                "time", {"source": draft.time, "from": clock.unit.unit, "unit": "s"},
                f"In {clock.unit.unit}: {clock.unit.reason}.",
            )
        )  # fmt: skip


def _name(column: Column, taken: set[str]) -> str:
    """A short name: that of the column without its unit."""
    parts = pieces(column.name)
    if len(parts) > 1 and (
        column.unit.sure and ("ends" in column.unit.reason or "(" in column.name)
    ):
        parts = parts[:-1]
    short = plain("_".join(parts))
    for name in (short, plain(f"{column.part}_{short}")):
        if name not in taken and name != "time":
            return name
    return next(n for i in range(2, 999) if (n := f"{short}_{i}") not in taken)


def _column(
    name: str, match: Match, runs: Sequence[Run], plan: Layout, drives: bool
) -> ColumnEntry:
    column, unit = match.column, match.column.unit
    keys: dict[str, object] = {"source": column.source}
    remarks = [f"{match.place.name}: {match.reason}."]
    part, reports = runs[0].parts[column.part], [r.parts[column.part].report for r in runs]
    quaternion = part.report.topic.made.get(column.name, ()) if plan.whole else ()
    if quaternion:
        keys = {"quaternion": [replace(column, name=name).source for name in quaternion]}
    if column.part != plan.main:
        keys["time"] = f"{column.part}.{clock_column(part, plan.whole)}"
        if drives:
            keys["hold"] = True
        if behind := plan.behind(column.part):
            keys["late"] = _nice(behind)
            remarks.append(f"Its clock is {abs(behind):g} s {'late' if behind > 0.0 else 'early'} "
                           f"against that of {plan.main}, as given.")  # fmt: skip
    stated = part.report.topic.log.units.get(column.name) == unit.unit or (
        not plan.whole and unit.sure and "--map" not in unit.reason
    )
    if unit.unit:
        if not stated and not quaternion:
            keys["from"] = unit.unit
        remarks.append(f"In {unit.unit}: {unit.reason}{'' if unit.sure else ' (a guess)'}.")
    if match.place.unit and unit.unit and not (stated and match.place.unit == unit.unit):
        keys["unit"] = match.place.unit
    if (
        not drives
        and is_angle(match.place.unit)
        and any(turn_of(report.topic.log[column.name])[0] for report in reports)
    ):
        keys["unwrap"] = True
        remarks.append("It begins anew at a turn.")
    if any(column.name in lost(r.topic, r.clock.column) for r in reports):
        keys["missing"] = 0
        remarks.append("Where it is exactly 0 together with others, nothing was measured.")
    for run in runs:
        for finding in run.parts[column.part].report.findings:
            if finding.column == column.name and finding.kind in ("spikes", "saturated"):
                remarks.append(f"Run {run.name}: {finding.text}.")
    return ColumnEntry(name, keys, " ".join(remarks))


def _channel(variable: str, match: Match, runs: Sequence[Run]) -> Entry:
    noises, steps, spans = [], [], []
    for run in runs:
        report = _report(run, match.column.part, match.column.name)
        if report is not None and report.high > report.low:
            noises.append(report.noise)
            steps.append(report.resolution)
            spans.append(report.high - report.low)
    noise, step = float(np.median(noises)), float(np.median(steps))
    factor = 1.0
    if match.column.unit.unit and match.place.unit:
        factor = abs(conversion(parse(match.column.unit.unit), parse(match.place.unit))[0])
    rounding = step / np.sqrt(12.0)
    unit = match.place.unit
    if noise > 0.5 * rounding:
        sigma, why = max(noise, rounding), "estimated from the log: what is white in it"
    else:
        sigma = max(rounding, GUESSED * max(spans))
        why = "a guess, a thousandth of its range: the log shows no noise"
    keys = {"signal": variable, "sigma": float(f"{sigma * factor:.2g}")}
    return Entry(keys, f"sigma in {unit or 'the unit of the signal'}: {why}.")


def _clock_nuisance(key: str, channels: Sequence[str], plan: Layout) -> Entry:
    reference = " and ".join(plan.command) or "the commands"
    text = (
        f"How late the clock of {key or 'the log'} is against that of {reference}: another "
        "computer, another driver, the time a camera takes. Estimated for all runs together. A "
        "delay of all commands looks the same, and is in it: who knows how late the clock is "
        f"imports with --late {key or 'PART'}=SECONDS, and the rest is named as a delay."
    )
    return Entry(
        {"name": f"clock of {key}", "unit": "s", "nominal": 0.0, "min": -plan.late,
         "max": plan.late, "targets": [f"clock:{name}" for name in channels]}, text,
    )  # fmt: skip


def _run(run: Run, files: Mapping[str, str], plan: Layout) -> Entry:
    keys: dict[str, object] = {"name": run.name}
    if "" in files:
        keys["file"] = files[""]
    else:
        keys["files"] = dict(files)
    keys["purpose"] = run.purpose
    remark = ""
    span = covered(run, plan)
    if span is not None:
        keys["samples"] = list(span)
        remark = "Only the samples between the first and the last command."
    if plan.window:
        keys["window"] = plan.window
    return Entry(keys, remark)


def covered(run: Run, plan: Layout) -> tuple[int, int] | None:
    """Samples of the main clock during which the inputs are known, None if that is all."""
    main = run.parts[plan.main].report
    times = _absolute(run.parts[plan.main])
    first, last = 0, times.size - 1
    for key in plan.command:
        if key == plan.main:
            continue
        own = _absolute(run.parts[key]) - plan.behind(key)
        own = own[np.isfinite(own)]
        if not own.size or main.clock.epoch != run.parts[key].report.clock.epoch:
            continue
        first = max(first, int(np.searchsorted(times, own[0])))
        clock = run.parts[key].report.clock
        if clock.jitter < 0.2 and not clock.gaps:
            end = own[-1] + SHORT_TAIL * clock.interval
            last = min(last, int(np.searchsorted(times, end, "right")) - 1)
    if last <= first:
        raise InputError(
            f"run {run.name}: its commands and its measurements are at different times; compare "
            "the clocks with `cosim data inspect`"
        )
    return None if (first, last) == (0, times.size - 1) else (first + 1, last + 1)


def _absolute(part: Part) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    clock = part.report.clock
    return clock.times + clock.first
