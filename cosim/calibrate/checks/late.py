"""Columns on a clock of their own, and inputs that come after what they cause: told by a fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...errors import CosimError
from ..fit import fit
from .finding import Finding
from .times import interval

if TYPE_CHECKING:
    from ..estimate import Estimate

Vector = NDArray[np.float64]
OFF = 1.5
"""Mean square over the noise's above which a fit leaves something to explain."""
REACH, PART = 64, 8
"""Samples by which columns are shifted, and the share of a run that this may take at most."""
LEAVES = 0.2
"""Share of the excess that a shift may leave, to first order, to be tried in a fit."""
ROWS = 1500
"""Samples of a run that are looked at, at least, where it has many more."""
ROUNDS, EXACT = 4, 0.02
"""Fits at most, and the part of a sample below which a shift is found."""
LEFT = 0.1
"""Share of the excess that a shift may leave once fitted, to be all that is wrong: what is missing
in a machine is a shift of one column by chance only."""


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
    named if that leaves less than `LEFT` of it: one number that takes n residuals of variance `OFF`
    and more to within a tenth of the noise's 1 is not of chance (the excess has a deviation of
    sqrt(2 / n)). A physical cause that shifts one column and does nothing else is the same in the
    data, and is mended or let pass in the same way. All channels together are named only if they
    come before the inputs, which no machine does: one that answers late is a machine.
    """
    problem = estimate.problem
    before = 2.0 * estimate.cost / max(estimate.count, 1)
    if problem.unstable or before < OFF or not estimate.jacobian:
        return
    steps = [interval(problem.run(name).times) for name, _ in estimate.residuals]
    if max(steps) > 1.01 * min(steps):
        return
    groups: list[tuple[int, ...]] = [(i,) for i in range(len(problem.channels))]
    if len(groups) > 1:
        groups.append(tuple(range(len(problem.channels))))
    found = [shift for group in groups if (shift := _best(estimate, group)) is not None]
    found = [s for s in found if len(s.channels) == 1 or s.samples < 0.0]
    for shift in sorted(found, key=lambda s: s.excess)[:2]:
        if shift.excess > LEAVES or abs(shift.samples) < 0.25:
            continue
        late, after = _fitted(estimate, shift, steps[0])
        if after - 1.0 > LEFT * (before - 1.0):
            continue
        gain = f"the mean square over the noise's falls from {before:.3g} to {after:.3g}"
        if len(shift.channels) == 1:
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
        yield Finding("error", "clock", "", name, text)
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
        moved = problem._with(channels=channels, runs=runs)
        try:
            again = fit(moved, theta, limit=8, polish=False)
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


def _best(estimate: Estimate, group: Sequence[int]) -> _Shift | None:
    """The shift that leaves least, to first order."""
    problem = estimate.problem
    size = len(problem.parameters)
    matrix = np.zeros((size, size))
    fixed, total, counted = np.zeros(size), 0.0, 0
    runs: list[tuple[Vector, Vector, Vector, NDArray[np.intp], int]] = []
    reach = min([REACH, *(len(r) // PART for _, r in estimate.residuals)])
    if reach < 2:
        return None
    others = [i for i in range(len(problem.channels)) if i not in group]
    for item, (name, residual) in zip(estimate.jacobian, estimate.residuals, strict=True):
        data = problem.run(name).data / problem.sigma
        values = item.values * problem.scale[item.columns]
        stride = max(len(residual) // ROWS, 1)
        rest = _rows(residual[::stride, others], values[::stride, others])
        matrix[np.ix_(item.columns, item.columns)] += rest[1].T @ rest[1]
        fixed[item.columns] += rest[1].T @ rest[0]
        total, counted = total + float(rest[0] @ rest[0]), counted + rest[0].size
        inner = slice(reach, len(residual) - reach, stride)
        model = (data - residual)[inner][:, list(group)]
        slopes = values[inner][:, list(group)]
        runs.append((data[:, list(group)], model, slopes, item.columns, stride))
        own = _rows(model, slopes)[1]
        matrix[np.ix_(item.columns, item.columns)] += own.T @ own
    matrix += 1e-9 * max(float(np.trace(matrix)), 1.0) * np.eye(size)

    def left(samples: int) -> float:
        gradient, square, number = fixed.copy(), total, counted
        for data, model, slopes, columns, stride in runs:
            late = data[reach + samples : len(data) - reach + samples : stride]
            residual, slope = _rows(late - model, slopes)
            gradient[columns] += slope.T @ residual
            square, number = square + float(residual @ residual), number + residual.size
        return square - float(gradient @ np.linalg.solve(matrix, gradient)) - number

    costs = {samples: left(samples) for samples in range(-reach, reach + 1)}
    best = min(costs, key=lambda samples: costs[samples])
    if abs(best) == reach:
        return None
    below, least, above = (costs[best + k] for k in (-1, 0, 1))
    bend = below - 2.0 * least + above
    shift = best + (0.5 * (below - above) / bend if bend > 0.0 else 0.0)
    return _Shift(tuple(group), shift, least / costs[0] if costs[0] > 0.0 else 1.0)


def _rows(residual: Vector, slopes: Vector) -> tuple[Vector, Vector]:
    """Residuals that were measured, and their derivatives."""
    good = np.isfinite(residual) & np.isfinite(slopes).all(axis=2)
    return residual[good], slopes[good]
