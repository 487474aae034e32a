"""Sample times: too few, going back, uneven, missing, or not at the stated rate and step."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..clocks import clocked
from ..parts import COINCIDENT, MeasuredRun
from .finding import Finding

if TYPE_CHECKING:
    from ..problem import Problem

Vector = NDArray[np.float64]
SHORT = 50
"""Fewer samples than this are no run, unless most runs are as short: windows of a log. All runs
together need as many."""
GAP = 5.0
"""Intervals longer than this many usual ones are worth a word."""
UNEVEN = 0.15
"""Deviation over the interval from which a clock jitters: stamps that are off by up to a fifth have
0.16 (a sqrt(2/3)); real recorders that are even but for their scheduler have 0.11 at most."""
EVEN = 0.02
"""Deviation over the interval below which it is even, but for rounding."""
MANY = 200
"""Communication steps between samples of a clock of whole numbers from which it hardly counts
seconds: a step that is right leaves next to nothing at a tenth of that."""
RATE = 1e-3
"""Share by which a clock may differ from the stated rate: quartz keeps 1e-4, float32 rounds to 1e-7
of the time."""


def interval(times: Vector) -> float:
    """Usual interval between samples: the mean of those that are even.

    So neither rounding nor missing rows count; where most are uneven, only gaps do not.
    """
    steps = np.diff(times)
    usual = float(np.median(steps))
    even = np.abs(steps - usual) < EVEN * usual
    counted = even if np.mean(even) > 0.5 else steps < GAP * usual
    return float(np.mean(steps[counted])) if counted.any() else usual


def check_times(problem: Problem) -> Iterator[Finding]:
    """Faults of the clocks, run by run and between runs; none of these tests is of chance."""
    sizes = [run.times.size for run in problem.runs]
    windows = sum(sizes) >= SHORT
    least = min(SHORT, int(np.median(sizes))) if windows else SHORT
    for run in problem.runs:
        yield from _run(problem, run, least)
    if problem.source.rate is None:  # else each clock has been compared with that
        yield from _units(problem)
    yield from _recorded(problem)


def _recorded(problem: Problem) -> Iterator[Finding]:
    """A stated time between recorded points that is no whole number of communication steps."""
    if problem.period is None:
        return
    for key, step in {"step": problem.step, "search_step": problem.search.step}.items():
        count = problem.period / step
        near = max(round(count), 1)
        if abs(count - near) > COINCIDENT * near and (key == "step" or step != problem.step):
            text = (
                f"period = {problem.period:g} s is no whole number of communication steps of "
                f"{step:g} s ({count:.4g}): points would be recorded every {near * step:g} s; take "
                f"{key} = {_dividing(problem.period, count):.6g}, or another period"
            )
            yield Finding("error", "step", "", "time", text)


def _dividing(period: float, count: float) -> float:
    """The longest step that divides a period into as many parts or more, and has few digits."""
    least = math.ceil(count)
    for parts in range(least, 10 * least):  # a power of ten, one of which is among them, divides it
        step = period / parts
        if math.isclose(step, float(f"{step:.3g}"), rel_tol=1e-9):
            return step
    return period / least


def _units(problem: Problem) -> Iterator[Finding]:
    """Clocks that count in thousandths of the unit that the other runs, period or step are in.

    A period that is a thousandth of the interval to 2 % (`EVEN`) contradicts it. Only where a clock
    is estimated are points wanted so close together: what is measured lies between them then.
    """
    each = {run.name: interval(run.times) for run in problem.runs if run.times.size > 1}
    if not each or min(each.values()) <= 0.0:
        return
    least = min(each.values())
    for name, mean in each.items():
        if _thousands(mean / least):
            text = (
                f"has samples every {mean:.6g} s, those of {min(each, key=lambda n: each[n])} are "
                f"{least:.6g} s apart: the unit of one of the two clocks looks wrong; write the "
                'unit into the head ("time [ms]"), or give scale of the clock in [columns]'
            )
            yield Finding("error", "rate", name, "time", text)
    way = (
        'if the clock counts thousandths of a second, write the unit into its head ("time [ms]"), '
        "or give its scale in [columns]"
    )
    period = None if clocked(problem.parameters) else problem.period
    if period is not None and _thousands(least / period):
        text = (
            f"samples are {least:.6g} s apart, but period = {period:g} s, {least / period:.6g} "
            f"times less: {way}; else mend period"
        )
        yield Finding("error", "rate", "", "time", text)
    elif _thousands(least / problem.step) or (least / problem.step > MANY and _whole(problem)):
        text = (
            f"samples are {least:.6g} s apart, {least / problem.step:.6g} communication steps: "
            f"{way}"
        )
        yield Finding("warning", "rate", "", "time", text)


def _whole(problem: Problem) -> bool:
    """Whether all clocks count whole numbers: rather of something smaller than seconds."""
    since = [run.times - run.times[0] for run in problem.runs if run.times.size > 1]
    return all(bool(np.all(times == np.rint(times))) for times in since)


def _thousands(ratio: float) -> bool:
    """Whether a ratio is 1e3, 1e6 or 1e9 as exactly as clocks agree."""
    power = round(float(np.log10(ratio)) / 3.0)
    return power >= 1 and abs(ratio / 1e3**power - 1.0) < EVEN


def _run(problem: Problem, run: MeasuredRun, least: int) -> Iterator[Finding]:
    steps = np.diff(run.times)
    if run.times.size < max(least, 2):
        text = f"has {run.times.size} samples; a run needs {max(least, 2)} or more"
        yield Finding("error", "short", run.name, "time", text)
        return
    if np.any(steps <= 0.0):
        at = run.logged[int(np.flatnonzero(steps <= 0.0)[0])]
        text = f"does not increase after {at:.6g} s"
        yield Finding("error", "clock", run.name, "time", text)
        return
    usual = float(np.median(steps))
    if np.max(steps) > GAP * usual:
        at = run.logged[int(np.argmax(steps))]
        text = f"has a gap of {np.max(steps):.4g} s after {at:.6g} s (interval {usual:.4g} s)"
        yield Finding("warning", "gap", run.name, "time", text)
    even = np.abs(steps - usual) < EVEN * usual
    lost = np.rint(steps[~even] / usual) - 1.0
    if np.mean(even) > 0.5 and np.any(lost > 0.0):
        text = (
            f"lacks {np.sum(lost[lost > 0.0]):.0f} rows in {np.count_nonzero(lost > 0.0)} places; "
            "set values are held over up to five intervals"
        )
        yield Finding("warning", "gap", run.name, "time", text)
    # lost rows among even ones are told above, and are no jitter
    spread = float(np.std(steps[np.rint(steps / usual) < 2.0] if np.mean(even) > 0.5 else steps))
    if spread > UNEVEN * usual:
        text = f"jitters: intervals {usual:.4g} s with a deviation of {spread:.2g} s"
        yield Finding("warning", "jitter", run.name, "time", text)
    yield from _stated(problem, run)


def _stated(problem: Problem, run: MeasuredRun) -> Iterator[Finding]:
    """A clock against the rate of the data set, and against the communication step."""
    mean = interval(run.times)
    rate = problem.source.rate
    if rate is not None and abs(mean * rate - 1.0) > RATE and problem.source.as_logged:
        text = (
            f"runs at {1.0 / mean:.6g} samples per second, but set.toml says "
            f"{rate:.6g}: the clock is {abs(mean * rate - 1.0):.2%} "
            f"{'fast' if mean * rate > 1.0 else 'slow'}, or the rate is another; mend the times "
            "(scale in [columns]) or sample_rate_hz"
        )
        yield Finding("error", "rate", run.name, "time", text)
        return
    steps = np.diff(run.times)
    count = mean / problem.step
    near = max(round(count), 1)
    even = float(np.std(steps)) < EVEN * mean
    if problem.period is None and even and abs(count - near) > COINCIDENT * near:
        text = (
            f"has samples every {mean:.6g} s, which the communication step of {problem.step:g} s "
            f"does not divide ({count:.4g} steps); take step = {mean / near:.6g}, or give period"
        )
        yield Finding("error", "step", run.name, "time", text)
