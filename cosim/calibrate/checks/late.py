"""Columns on a clock of their own, and inputs that come after what they cause: told by a fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...errors import CosimError
from ..fit import Effort, fit
from .finding import Finding
from .times import interval

if TYPE_CHECKING:
    from ..estimate import Estimate

Vector = NDArray[np.float64]
OFF = 1.5
"""Mean square over the noise's above which a fit leaves something to explain: before a shift, or
else there is none to look for; after that of a column, or else it is not all that is wrong, and
laws are asked, delays of columns among them."""
REACH, PART = 64, 8
"""Samples by which columns are shifted, and the share of a run that this may take at most."""
LEAVES = 0.2
"""Share of the excess that a shift may leave, to first order, to be tried in a fit."""
ROWS = 1500
"""Samples of a run that are looked at, at least, where it has many more."""
ROUNDS, EXACT = 4, 0.02
"""Fits at most, and the part of a sample below which a shift is found."""
AGAIN = Effort(end="intervals", iterations=8)
"""Of each of these fits: what a shift leaves shows before the last digits."""
LEFT = 0.1
"""Share of the excess that a shift may leave once fitted, to be all that is wrong: what is missing
in a machine is a shift of one column by chance only."""
ALL = 0.01
"""The same up to which a shift of the inputs is said to be all that is wrong: a tenth of its RMS.
Of a disc with 1 % of the excess left, the shift is off by 1 %."""


@dataclass(frozen=True)
class _Shift:
    """Some channels in all runs, shifted by so many samples; the share of the excess that stays."""

    channels: tuple[int, ...]
    samples: float
    excess: float


def check_late(estimate: Estimate) -> Iterator[Finding]:
    """One shift in time that explains all that a fit leaves.

    The data of a channel (or of all channels against the inputs) are shifted against the model from
    `-REACH` to `REACH` samples. With J the derivatives by the parameters, what calibration cannot
    absorb of the residual r(s) is

        |r(s)|^2 - r(s)' J (J' J)^-1 J' r(s)

    A shift that leaves less than `LEAVES` of its excess over the noise is tried in a fit. It is
    named if that leaves less than `LEFT` of it, and of one column no more than `OFF`: one number
    that takes n residuals of variance `OFF` and more to within a tenth of the noise's 1 is not of
    chance (the excess has a deviation of sqrt(2 / n)). A physical cause that shifts one column and
    does nothing else is the same in the data, and is mended or let pass in the same way. All
    channels together are named only if they come before the inputs, which no machine does: one that
    answers late is a machine. If they leave more than `ALL` of the excess then, something else is
    wrong, too, which draws the shift: a warning.
    """
    problem = estimate.problem
    before = 2.0 * estimate.cost / max(estimate.count, 1)
    if problem.unstable or before < OFF or not estimate.jacobian:
        return
    if any(run.noise is not None for run in problem.runs):
        return  # what is left is made white over time, and no column of the log any more
    steps = [interval(problem.run(name).times) for name, _ in estimate.residuals]
    if max(steps) > 1.01 * min(steps):
        return
    groups: list[tuple[int, ...]] = [(i,) for i in range(len(problem.channels))]
    if len(groups) > 1:
        groups.append(tuple(range(len(problem.channels))))
    sums = _Sums(estimate)
    found = [shift for group in groups if (shift := _best(estimate, group, sums)) is not None]
    found = [s for s in found if len(s.channels) == 1 or s.samples < 0.0]
    for shift in sorted(found, key=lambda s: s.excess)[:2]:
        if shift.excess > LEAVES or abs(shift.samples) < 0.25:
            continue
        late, after = _fitted(estimate, shift, steps[0])
        single = len(shift.channels) == 1
        if (single and after > OFF) or after - 1.0 > LEFT * (before - 1.0):
            continue
        gain = f"the mean square over the noise's falls from {before:.3g} to {after:.3g}"
        if single:
            name = problem.channels[shift.channels[0]].name
            text = (
                f"is {'late' if late > 0 else 'early'} by {abs(late):.4g} s against the other "
                f"columns, and nothing else is wrong: with it, {gain}. Its clock is another one, "
                f"or its sensor is late; give late = {late:.4g} in [columns]"
            )
        else:
            name = ", ".join(
                {s.text.rpartition(":")[2]: 0 for r in problem.runs for s in r.inputs.values()}
            )
            text = (
                f"comes {abs(late):.4g} s after what it causes: with it so much earlier, {gain}. "
                f"The clock of the inputs is late; give late = {abs(late):.4g} in [columns]"
            )
        beside = not single and after - 1.0 > ALL * (before - 1.0)
        if beside:
            text += " once it is known what else is wrong: that moves this figure, too"
        yield Finding("warning" if beside else "error", "clock", "", name, text)
        return


def _fitted(estimate: Estimate, shift: _Shift, step: float) -> tuple[float, float]:
    """How late the channels are [s], and the mean square over the noise's that this leaves.

    The first fit begins at nominal values: those of the estimate made the best of the wrong times.
    """
    problem, theta, late, after = estimate.problem, None, 0.0, np.inf
    for _ in range(ROUNDS):
        late += shift.samples * step
        channels = [
            replace(c, shift=c.shift - late) if i in shift.channels else c
            for i, c in enumerate(problem.channels)
        ]
        # a model that is read later ends as much later than its inputs
        lost = max(int(np.ceil(-late / step)), 0)
        runs = [
            replace(r, times=r.times[: r.times.size - lost], data=r.data[: r.times.size - lost])
            for r in problem.runs
        ]
        moved = estimate.simulator.of(problem.changed(channels=channels, runs=runs))
        try:
            again = fit(moved, theta, effort=AGAIN)
        except CosimError:  # what cannot be fitted explains nothing
            return late, after
        finally:
            moved.close()
        theta, after = again.theta, 2.0 * again.cost / max(again.count, 1)
        finer = _best(again, shift.channels)
        if finer is None or abs(finer.samples) < EXACT:
            break
        shift = finer
    return late, after


def _best(estimate: Estimate, group: Sequence[int], sums: _Sums | None = None) -> _Shift | None:
    """The shift that leaves least, to first order."""
    sums = sums or _Sums(estimate)
    reach = sums.reach
    if reach < 2:
        return None
    others = [i for i in range(len(estimate.problem.channels)) if i not in group]
    matrix = sum((sums.matrix[i] for i in others), np.zeros_like(sums.matrix[0]))
    fixed = sum((sums.gradient[i] for i in others), np.zeros_like(sums.gradient[0]))
    total = sum(sums.square[i] - sums.count[i] for i in others)
    parts = [part for part in sums.parts if part.channel in group]
    for part in parts:
        own = part.slopes[np.isfinite(part.model)]
        matrix[np.ix_(part.columns, part.columns)] += own.T @ own
    matrix += 1e-9 * max(float(np.trace(matrix)), 1.0) * np.eye(len(matrix))
    inverse = np.linalg.inv(matrix)

    def left(samples: int) -> float:
        gradient, excess = fixed.copy(), total
        for part in parts:
            end = len(part.data) - reach + samples
            residual = part.data[reach + samples : end : part.stride] - part.model
            good = np.isfinite(residual)
            gradient[part.columns] += part.slopes[good].T @ residual[good]
            excess += float(np.sum(residual[good] ** 2)) - np.count_nonzero(good)
        return float(excess - gradient @ inverse @ gradient)

    costs = {samples: left(samples) for samples in range(-reach, reach + 1)}
    best = min(costs, key=lambda samples: costs[samples])
    if abs(best) == reach:
        return None
    below, least, above = (costs[best + k] for k in (-1, 0, 1))
    bend = below - 2.0 * least + above
    shift = best + (0.5 * (below - above) / bend if bend > 0.0 else 0.0)
    return _Shift(tuple(group), shift, least / costs[0] if costs[0] > 0.0 else 1.0)


@dataclass(frozen=True)
class _Part:
    """One channel of one run: all its data, and the model inside of what shifts reach."""

    channel: int
    data: Vector
    model: Vector
    slopes: Vector
    columns: NDArray[np.intp]
    stride: int


class _Sums:
    """What every shift needs of an estimate: normal equations by channel, and its parts."""

    def __init__(self, estimate: Estimate) -> None:
        problem = estimate.problem
        count, size = len(problem.channels), len(problem.parameters)
        self.reach = min([REACH, *(len(r) // PART for _, r in estimate.residuals)])
        self.matrix = np.zeros((count, size, size))
        self.gradient = np.zeros((count, size))
        self.square, self.count = np.zeros(count), np.zeros(count)
        self.parts: list[_Part] = []
        for item, (name, residual) in zip(estimate.jacobian, estimate.residuals, strict=True):
            stride = max(len(residual) // ROWS, 1)
            inner = slice(self.reach, len(residual) - self.reach, stride)
            data = problem.run(name).data / problem.sigma
            columns = item.columns
            for i in range(count):
                slopes = np.nan_to_num(item.values[:, i]) * problem.scale[columns]
                rest, slope = residual[::stride, i], slopes[::stride]
                good = np.isfinite(rest)
                self.matrix[i][np.ix_(columns, columns)] += slope[good].T @ slope[good]
                self.gradient[i][columns] += slope[good].T @ rest[good]
                self.square[i] += float(np.sum(rest[good] ** 2))
                self.count[i] += np.count_nonzero(good)
                model = (data[:, i] - residual[:, i])[inner]
                self.parts.append(_Part(i, data[:, i], model, slopes[inner], columns, stride))
