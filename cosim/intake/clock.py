"""The clock of a topic: which column it is, its unit and origin, its rate, and how even it is."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..calibrate.checks.times import interval
from ..calibrate.stamps import EPOCH
from ..errors import UnitError
from ..spec.units import parse
from .guess import Guess, guess_time
from .topic import Topic
from .words import TIME, words

Vector = NDArray[np.float64]
RISES = 0.95
"""Share of steps that must go forward in a column that is a clock: logs may be there twice."""
GAP = 5.0
"""Intervals longer than this many usual ones are gaps (`calibrate.checks.times`)."""


@dataclass(frozen=True)
class Clock:
    """Times of a topic.

    Attributes:
        column: that holds them, "" if there is none.
        unit: and why.
        times: since the first sample [s], NaN where there is none; empty without a clock.
        first: the first time, as the clock counts [s].
        epoch: whether it counts from 1970.
        interval: usual one [s].
        jitter: deviation of the intervals over the usual one, gaps left out.
        gaps: (time [s], length [s]) of intervals that are longer than `GAP` usual ones.
        same, back: steps that stand still, and that go back.
    """

    column: str
    unit: Guess
    times: Vector
    first: float = 0.0
    epoch: bool = False
    interval: float = 0.0
    jitter: float = 0.0
    gaps: tuple[tuple[float, float], ...] = ()
    same: int = 0
    back: int = 0

    @property
    def begin(self) -> float | None:
        """The first time since 1970 [s], None if it does not count from there."""
        return self.first if self.epoch else None

    @property
    def duration(self) -> float:
        """From the first to the last sample [s]."""
        good = self.times[np.isfinite(self.times)]
        return float(good[-1] - good[0]) if good.size else 0.0

    def began(self) -> str:
        """Date and time of the first sample, "" if unknown."""
        if self.begin is None:
            return ""
        try:
            moment = datetime.fromtimestamp(self.begin, UTC)
        except (OverflowError, ValueError, OSError):
            return ""
        return moment.isoformat(sep=" ", timespec="milliseconds").removesuffix("+00:00") + " UTC"

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "column": self.column, "unit": self.unit.unit, "reason": self.unit.reason,
            "sure": self.unit.sure, "begin": self.began(), "begin_s": self.begin,
            "duration_s": self.duration, "interval_s": self.interval,
            "rate_hz": 1.0 / self.interval if self.interval > 0.0 else None,
            "jitter": self.jitter, "gaps": [list(gap) for gap in self.gaps],
            "same_times": self.same, "steps_back": self.back,
        }  # fmt: skip


def find_clock(topic: Topic) -> Clock:
    """The clock of a topic, without one where no column rises as a clock does."""
    column = topic.clock or _column(topic)
    if not column:
        return Clock("", Guess("", "no column rises as a clock does"), np.zeros(0))
    log = topic.log
    raw, origin = log[column], log.origins.get(column, 0)
    unit = guess_time(column, raw, log.units.get(column, ""), origin)
    factor = _factor(unit.unit)
    times = raw * factor
    good = np.isfinite(times)
    if not good.any():
        return Clock(column, unit, np.zeros(0))
    first = times[good][0]
    since = first + origin * factor
    epoch = EPOCH[0] <= since <= EPOCH[1]
    times = times - first
    steps = np.diff(times[good])
    if not steps.size:
        return Clock(column, unit, times, since, epoch)
    forward = steps[steps > 0.0]
    usual = interval(np.append(0.0, np.cumsum(forward))) if forward.size else 0.0
    whole = steps[(steps > 0.0) & (steps <= GAP * usual)]
    at = times[good][:-1]
    gaps = tuple((float(a), float(s)) for a, s in zip(at, steps, strict=True) if s > GAP * usual)
    return Clock(
        column, unit, times, since, epoch, usual,
        float(np.std(whole) / usual) if whole.size and usual > 0.0 else 0.0,
        gaps, int(np.count_nonzero(steps == 0.0)), int(np.count_nonzero(steps < 0.0)),
    )  # fmt: skip


def _factor(unit: str) -> float:
    try:
        found = parse(unit)
    except UnitError:
        return 1.0
    return found.factor if found.exponents == parse("s").exponents else 1.0


def _column(topic: Topic) -> str:
    """The column that is a clock: by its name, if it rises; else the first, if it rises evenly."""
    log = topic.log
    named = [name for name in log.columns if TIME in words(name)]
    named.sort(key=lambda name: words(name).index(TIME))
    for name in named:
        if rises(log[name]):
            return name
    first = next(iter(log.columns), "")
    if first and rises(log[first]) and _even(log[first]):
        return first
    return ""


def rises(values: Vector) -> bool:
    """Whether a column rises as a clock does."""
    steps = np.diff(values[np.isfinite(values)])
    return bool(steps.size and np.mean(steps > 0.0) > RISES and np.median(steps) > 0.0)


def _even(values: Vector) -> bool:
    """Whether most steps have one size: what else rises does not."""
    steps = np.diff(values[np.isfinite(values)])
    usual = float(np.median(steps))
    return bool(np.mean(np.abs(steps - usual) < 0.5 * usual) > RISES)
