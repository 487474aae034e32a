"""How something may change over a series of logs, and whether a series of numbers does.

    step      other from a log on
    creep     grows with time from the log before on
    outlier   other in one log only
    spell     other from a log up to another one, then as before

A number per log, independent and normal about a constant with an unknown spread, is regressed on
the constant and one profile. The slope over its deviation is Student's t if nothing has changed,
whatever the spread is. Over all profiles and all numbers, the chance that one of them exceeds a
threshold is at most the sum of their chances (Bonferroni), so the stated rate is shared by
what lasts or is one log, by what passes, of which there are many more, and by all pairs. Without
these, a change that is undone later, or two changes, would count as scatter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

Vector = NDArray[np.float64]
Kind = Literal["step", "creep", "outlier", "spell"]
ASIDE = 2
"""Logs on either side of a step at least: a single one is an outlier."""
EACH, WIDER = 32, 1.1
"""Spells of up to so many logs have every length; longer ones differ by this factor, since their
number would grow with the square of that of the logs."""
PARTS = 3
"""Of the rate: for what lasts or is one log, for spells, for pairs."""
MEDIAN = 1.4826
"""Deviation of normal numbers over the median of their sizes."""
GROUP = 4
"""Logs of one excitation that have a mean of their own; where there are fewer, all share one."""


@dataclass(frozen=True)
class Profile:
    """One way to change.

    Attributes:
        kind: see above.
        first: index of the first log that differs.
        values: by log; 1 for a step, an outlier and a spell, days for a creep; the rest tells them.
        last: index of the first log that is as before again; None if none is.
    """

    kind: Kind
    first: int
    values: Vector = field(compare=False)
    last: int | None = None

    def alike(self, other: Profile) -> bool:
        """Whether one quantity does not change in both ways: one would be the other's date."""
        if self.kind != other.kind:
            return False
        if self.last is not None and other.last is not None:
            return self.first <= other.last and other.first <= self.last
        return self.kind == "creep" or abs(self.first - other.first) < ASIDE


def profiles(days: Vector) -> list[Profile]:
    """All ways for logs at these times [d]."""
    count = days.size
    found = []
    for first in range(ASIDE, count - ASIDE + 1):
        found.append(Profile("step", first, (np.arange(count) >= first).astype(np.float64)))
    for first in range(ASIDE, count - ASIDE + 1):
        found.append(Profile("creep", first, np.maximum(days - days[first - 1], 0.0)))
    for first in range(count):
        found.append(Profile("outlier", first, (np.arange(count) == first).astype(np.float64)))
    for length in _lengths(count):
        for first in range(ASIDE, count - ASIDE - length + 1):
            last = first + length
            within = (np.arange(count) >= first) & (np.arange(count) < last)
            found.append(Profile("spell", first, within.astype(np.float64), last))
    return found


def shares(shapes: Sequence[Profile]) -> Vector:
    """By profile, into how many parts the rate is divided if this is one: of one in `PARTS`."""
    spells = np.array([shape.kind == "spell" for shape in shapes])
    sizes = np.where(spells, spells.sum(), (~spells).sum())
    return np.asarray(PARTS * sizes, dtype=np.float64)


def _lengths(count: int) -> list[int]:
    """Of spells [logs]."""
    found = [ASIDE]
    while found[-1] < count:
        found.append(found[-1] + 1 if found[-1] < EACH else round(WIDER * found[-1]))
    return found[:-1]


def constants(groups: Sequence[object]) -> Vector:
    """Columns of the constants: one per excitation that came often, one for all others."""
    known = list(groups)
    often = [key for key in dict.fromkeys(known) if known.count(key) >= GROUP]
    columns = [[float(key == one) for key in known] for one in often]
    others = [float(key not in often) for key in known]
    if any(others):
        columns.append(others)
    return np.array(columns).T


@dataclass(frozen=True)
class Regression:
    """One series of numbers against profiles.

    Attributes:
        slope, deviation: by profile.
        p: two-sided, by profile; 1 where the profile cannot be told from what is known.
        freedom: degrees of freedom.
    """

    slope: Vector
    deviation: Vector
    p: Vector
    freedom: int


def regress(values: Vector, weight: Vector, known: Vector, shapes: Vector) -> Regression:
    """Regress a series on what is known and one profile at a time.

    Args:
        values: one per log; NaN for none.
        weight: inverse variances, up to a factor.
        known: (logs, columns) of what is fitted anyway.
        shapes: (profiles, logs).
    """
    good = np.isfinite(values)
    root = np.sqrt(weight[good])
    before = known[good] * root[:, None]
    left, sizes, _ = np.linalg.svd(before, full_matrices=False)
    basis = left[:, sizes > 1e-9 * max(float(sizes.max(initial=0.0)), 1e-300)]
    freedom = int(good.sum()) - basis.shape[1] - 1
    nothing = np.zeros(len(shapes))
    if freedom < 1:
        return Regression(nothing, nothing + np.inf, nothing + 1.0, 0)

    def apart(of: Vector) -> Vector:
        return np.asarray(of - (of @ basis) @ basis.T)

    y = apart(values[good] * root)
    x = shapes[:, good] * root
    rest = apart(x)
    square = np.sum(rest**2, axis=1)
    seen = square > 1e-9 * np.maximum(np.sum(x**2, axis=1), 1e-300)
    safe = np.where(seen, square, 1.0)
    slope = np.where(seen, rest @ y / safe, 0.0)
    spread = np.maximum(float(y @ y) - slope**2 * safe, 0.0) / freedom
    deviation = np.sqrt(np.maximum(spread, 1e-300) / safe)
    p = np.where(seen, 2.0 * stdtr(freedom, -np.abs(slope) / deviation), 1.0)
    return Regression(slope, np.where(seen, deviation, np.inf), p, freedom)


def weights(values: Vector, deviations: Vector) -> Vector:
    """Inverse variances of a series whose numbers have deviations of their own, and scatter.

    The scatter comes from the median difference of successive numbers: a jump is in one of them.
    """
    good = np.isfinite(values) & np.isfinite(deviations)
    if good.sum() < 3:
        return np.ones_like(values)
    steps = np.diff(values[good])
    own = float(np.mean(deviations[good] ** 2))
    scatter = max(0.5 * float(MEDIAN * np.median(np.abs(steps))) ** 2 - own, 0.0)
    total = np.where(good, deviations, 1.0) ** 2 + scatter
    return np.asarray(1.0 / np.maximum(total, 1e-300))


def chances(values: Vector, deviations: Vector, known: Vector, shapes: Vector) -> Vector:
    """Probability of each profile if nothing has changed, two-sided.

    Weights are guessed from few logs; where these are not equally precise, what is seen with them
    alone is no change. So it must show with equal ones, too.

    Args:
        values, known, shapes: of `regress`.
        deviations: own ones of the numbers.
    """
    weighted = regress(values, weights(values, deviations), known, shapes).p
    return np.asarray(np.maximum(weighted, regress(values, np.ones_like(values), known, shapes).p))


def successive(series: Vector, known: Vector) -> float:
    """Correlation of successive logs beside what is known; 0 where chance makes as much."""
    basis = np.linalg.qr(known)[0]
    rest = series - basis @ (basis.T @ series)
    found = float(rest[1:] @ rest[:-1]) / max(float(rest @ rest), 1e-300)
    # 1 / sqrt(n) is its deviation, and over ten parameters 3 of them are rare
    return found if found > 3.0 / np.sqrt(rest.size) else 0.0


def reached(
    values: Vector, deviations: Vector, others: Vector, shapes: Vector, amounts: Vector
) -> Vector:
    """By profile, how small a series becomes with an amount of it, at most.

    What the logs that the profile leaves alone say of it counts, with twice its deviation.

    Args:
        values, deviations: one per log, other changes of it taken off.
        others: what these changes make of it, by log.
        shapes: (profiles, logs).
        amounts: by profile.
    """
    good = np.isfinite(values)
    weight = np.where(good, weights(values, deviations), 0.0)
    calm = (shapes == 0.0) * weight
    total = np.maximum(calm.sum(axis=1), 1e-300)
    most = calm @ np.where(good, values, 0.0) / total + 2.0 / np.sqrt(total)
    touched = np.where(shapes != 0.0, others + amounts[:, None] * shapes, np.inf)
    return np.asarray(most + touched.min(axis=1))


def paired(values: Vector, deviations: Vector, known: Vector, shapes: Vector) -> float:
    """Probability of two profiles together if nothing has changed: each hides the other's.

    The second is the best one beside the best, which is one of all pairs.
    """
    worst = 0.0
    for weight in (weights(values, deviations), np.ones_like(values)):
        first = regress(values, weight, known, shapes)
        best = int(np.argmin(first.p))
        second = regress(values, weight, np.column_stack([known, shapes[best]]), shapes)
        if second.freedom < 1:
            return 1.0
        # Student's t of each gives the share of the squares that is left
        left = 1.0
        for one in (first, second):
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                square = np.where(np.isfinite(one.deviation), (one.slope / one.deviation) ** 2, 0.0)
            left /= 1.0 + float(np.max(square)) / one.freedom
        worst = max(worst, left ** (0.5 * second.freedom))  # F with two degrees of freedom
    return worst
