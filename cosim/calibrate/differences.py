"""Derivatives of model values by differences, simulated in threads."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import FmuCallError
from .parts import MeasuredRun, Sensitivity
from .problem import Problem
from .simulator import Simulator

Vector = NDArray[np.float64]
STEP = 1e-3
"""Step of differences over the span of a parameter."""
UNEVEN = 0.01
"""Square of the disagreement of both sides, over that of the derivative, from which it is rough."""
TOLD = 16.0
"""Information on a parameter, per squared span, below which it does not matter."""


def jacobian(
    simulator: Simulator,
    theta: Vector,
    purpose: str | Iterable[str] | None = "identification",
    *,
    columns: Sequence[int] | None = None,
    central: bool = True,
    relative: float = STEP,
) -> list[Sensitivity]:
    """Derivatives of the model values over sigma, by differences inside the bounds.

    Args:
        simulator: of the problem.
        theta: where.
        purpose: runs.
        columns: parameters, all if not given.
        central: differences on both sides.
        relative: step over the span of a parameter, from its lattice on where it has one.
    """
    problem = simulator.problem
    runs = problem.chosen(purpose)
    tasks: list[tuple[MeasuredRun, int, float]] = []
    wanted = set(range(len(problem.parameters)) if columns is None else columns)
    owned = {
        run.name: [int(i) for i in problem.columns(run.name) if int(i) in wanted] for run in runs
    }
    sides = {i: _sides(problem, theta, i, central, relative) for i in wanted}
    for run in runs:
        if central or any(0.0 in sides[i] for i in owned[run.name]):
            tasks.append((run, -1, 0.0))
        tasks += [(run, i, h) for i in owned[run.name] for h in sides[i] if h]

    def simulate(task: tuple[MeasuredRun, int, float]) -> Vector:
        run, index, change = task
        moved = theta.copy()
        if index >= 0:  # sums round past bounds
            moved[index] = np.clip(
                moved[index] + change, problem.lower[index], problem.upper[index]
            )
        return simulator.simulate(moved, run)

    def beside(task: tuple[MeasuredRun, int, float]) -> tuple[float, Vector]:
        """The change that was made, and what it gave: where it cannot be, the opposite."""
        run, index, change = task
        try:
            return change, simulate(task)
        except FmuCallError:
            room = problem.lower[index] - theta[index], problem.upper[index] - theta[index]
            if index < 0 or not room[0] <= -change <= room[1]:
                raise
            return -change, simulate((run, index, -change))

    results = simulator.spread(beside, tasks)
    found = {(t[0].name, t[1], t[2]): r for t, r in zip(tasks, results, strict=True)}
    output = []
    for run in runs:
        gap = np.where(np.isfinite(run.data), 0.0, np.nan)
        mine = owned[run.name]
        values = np.empty((*run.data.shape, len(mine)))
        both = any(low and high for low, high in (sides[i] for i in mine))
        rough = np.zeros_like(values) if both else None
        for place, i in enumerate(mine):
            (low, first), (high, second) = (
                found[run.name, i if change else -1, change] for change in sides[i]
            )
            if low == high:  # one of both sides cannot be simulated
                low, first = found[run.name, -1, 0.0]
            values[:, :, place] = (second - first) / (high - low) / problem.sigma + gap
            if rough is not None and low and high:
                bend = first + second - 2.0 * found[run.name, -1, 0.0][1]
                rough[:, :, place] = bend / (high - low) / problem.sigma + gap
        rough = None if rough is None else run.white(rough)
        columns_ = np.array(mine, dtype=np.intp)
        output.append(Sensitivity(run.name, columns_, run.white(values), rough))
    return output


def unevenness(problem: Problem, item: Sensitivity) -> float:
    """Square of the largest disagreement of both sides over a derivative that matters."""
    if item.roughness is None:
        return 0.0
    told = np.nansum(item.values**2, axis=(0, 1))
    bends = np.nansum(item.roughness**2, axis=(0, 1))
    matters = told * problem.scale[item.columns] ** 2 > TOLD
    return float(np.max(bends[matters] / told[matters], initial=0.0))


def _sides(
    problem: Problem, theta: Vector, index: int, central: bool, relative: float
) -> tuple[float, float]:
    """The two changes between which a difference is taken; 0 is the point itself."""
    parameter, value = problem.parameters[index], float(theta[index])
    change = max(relative * parameter.scale, parameter.hints.lattice)
    above, below = parameter.maximum - value, value - parameter.minimum
    if (room := max(above, below)) > 0.0:
        change = min(change, room)
    if central and above >= change and below >= change:
        return -change, change
    return (0.0, change) if above >= change or above >= below else (-change, 0.0)
