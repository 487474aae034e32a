"""Values that concern one run only, fitted with everything else held.

A start pose is known to a millimetre and a few milliradians; a run that was not used for fitting
must have it estimated before its residual says anything about the model.

    min  loss of (measured - model) / sigma over the run + ((p - nominal) / prior)^2 / 2

(`loss.loss_for`) by Gauss-Newton steps with one Jacobian per run: these values move the model
almost linearly.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FmuCallError
from .differences import jacobian
from .loss import loss_for
from .parts import Sensitivity
from .problem import Problem
from .simulator import Simulator

Vector = NDArray[np.float64]
STEP = 5e-3
"""Step of the differences over the span."""
STEPS = 8
SHORTER, SHORTEST = 0.3, 0.05
"""A step that makes a run worse is tried again with this share of its length, down to the last."""
RELEASES, RELEASED = 3, 0.01
"""Times at most that late values are estimated with new derivatives, and the share of the cost that
each must remove to be followed by another one."""
HORIZONS = (0.1, 0.2, 0.4, 1.0)
"""Shares of a run from its beginning over which late values are estimated, one after the other. The
first metres tell a start angle; once casters have turned over, the error has many minima in it."""
OFF = 1.5
"""Cost over the noise's from which a run is tried once more from nominal late values."""
ENOUGH = 0.1
"""Fall of the cost [nats] below which a run is settled: far below anything that is decided."""


def concerned(problem: Problem, runs: Iterable[str]) -> list[int]:
    """Indices of the parameters that belong to one of these runs alone."""
    names = set(runs)
    return [i for i, p in enumerate(problem.parameters) if p.run in names]


def slopes(simulator: Simulator, theta: Vector, runs: Iterable[str]) -> dict[str, Sensitivity]:
    """Derivatives with respect to the runs' own parameters, by run."""
    names = list(runs)
    columns = concerned(simulator.problem, names)
    found = jacobian(simulator, theta, names, columns=columns, central=False, relative=STEP)
    return {item.run: item for item in found}


def settled(
    simulator: Simulator,
    theta: Vector,
    runs: Iterable[str],
    known: dict[str, Sensitivity] | None = None,
) -> Vector:
    """Parameters with the runs' own values fitted to each of them.

    Args:
        simulator: of system and data.
        theta: all values; those of other runs and common ones stay.
        runs: names.
        known: derivatives from `slopes`, taken here if not given. They need not be of this theta.
    """
    problem, names = simulator.problem, list(runs)
    columns = concerned(problem, names)
    theta = theta.copy()
    if not columns:
        return theta
    if known is None:
        known = slopes(simulator, theta, names)
    own = {name: [i for i in columns if problem.parameters[i].run == name] for name in names}
    costs: dict[str, float] = {}
    length = dict.fromkeys(names, 1.0)
    best, open_runs = theta.copy(), [name for name in names if own[name]]
    for _ in range(STEPS):
        going: list[str] = []
        for name, residual in simulator.residuals(theta, open_runs):
            cost = _cost(problem, theta, residual, own[name])
            fallen = costs.get(name, np.inf) - cost
            if fallen > 0.0:
                costs[name], best[own[name]] = cost, theta[own[name]]
            if fallen > ENOUGH:
                going.append(name)
                step = _step(problem, theta, residual, known[name], own[name])
                theta[own[name]] += length[name] * step
            elif fallen < -ENOUGH and length[name] > SHORTEST:
                going.append(name)
                length[name] *= SHORTER
                theta[own[name]] = best[own[name]] + SHORTER * (theta - best)[own[name]]
        theta = np.clip(theta, problem.lower, problem.upper)
        open_runs = going
        if not going:
            break
    return best


def starts(problem: Problem) -> list[float]:
    """Values at which late parameters are held."""
    known = {run.name: run.starts for run in problem.runs}
    return [
        next((known[p.run][n] / f for n, f in p.targets if n in known[p.run]), p.nominal)
        for p in problem.late
    ]


def late_values(problem: Problem) -> dict[str, dict[str, float]]:
    """Late values that runs begin with, by run and name."""
    found: dict[str, dict[str, float]] = {}
    for p in problem.late:
        starts = problem.run(p.run).starts
        for name, factor in p.targets[:1]:
            if name in starts:
                short = p.name.partition("@")[0]
                found.setdefault(p.run, {})[short] = starts[name] / factor
    return found


def late_estimated(problem: Problem) -> bool:
    """Whether late values of a problem have been estimated."""
    moved = np.subtract(starts(problem), [p.nominal for p in problem.late])
    # values are divided by a factor and multiplied again
    return bool(np.any(np.abs(moved) > 1e-9 * np.array([p.scale for p in problem.late])))


def released(simulator: Simulator, theta: Vector) -> tuple[Simulator, Vector, float]:
    """Estimate the late parameters of every run, with its other own values.

    Such values may move the model far from linearly, start angles of casters for instance, which
    turn over after an unstable moment. In a joint fit one such run would hold up all parameters;
    run by run, with steps that are shortened until they help, it harms none. The beginnings of the
    runs come first (see `HORIZONS`), but where they were estimated before and did well.

    Returns:
        Of the problem with these parameters held at what was found, all its values, and the fall
        of the cost [nats].
    """
    problem = simulator.problem
    start = starts(problem)
    every = simulator.of(problem.with_parameters([*problem.parameters, *problem.late]))
    whole = every.problem
    names = [run.name for run in problem.runs]
    first = np.clip(np.concatenate([theta, start]), whole.lower, whole.upper)
    anew = first.copy()
    anew[theta.size :] = whole.nominal[theta.size :]
    values, costs = first.copy(), _costs(every, first, names)
    before = sum(costs.values())

    def tried(theta: Vector, runs: list[str], horizons: tuple[float, ...]) -> None:
        try:
            found = _followed(every, theta, runs, horizons)
        except FmuCallError:
            if len(runs) > 1:  # one run that cannot be simulated there keeps what it has
                for name in runs:
                    tried(theta, [name], horizons)
            return
        for name, cost in _costs(every, found, runs).items():
            if cost < costs[name]:
                own = concerned(whole, [name])
                costs[name], values[own] = cost, found[own]

    moved = [n for n in names if np.any(first[(own := concerned(whole, [n]))] != anew[own])]
    tried(first, moved, HORIZONS[-1:])
    count = {run.name: np.count_nonzero(np.isfinite(run.data)) for run in problem.runs}
    off = [n for n in names if n not in moved or 2.0 * costs[n] > OFF * count[n]]
    tried(anew, off, HORIZONS)
    kept = dict(zip((p.name for p in problem.late), values[theta.size :].tolist(), strict=True))
    held = simulator.of(whole.hold(kept))
    return held, values[: theta.size], before - sum(costs.values())


def _followed(
    simulator: Simulator, theta: Vector, names: list[str], horizons: tuple[float, ...]
) -> Vector:
    """Values of some runs estimated over longer and longer beginnings."""
    if not names:
        return theta
    for share in horizons:
        part = simulator.of(_beginnings(simulator.problem, share))
        begun = cost = sum(_costs(part, theta, names).values())
        for _ in range(RELEASES):
            theta = settled(part, theta, names)
            after = sum(_costs(part, theta, names).values())
            if not after < cost - RELEASED * begun:
                break
            cost = after
    return theta


def _beginnings(problem: Problem, share: float) -> Problem:
    """The problem with only the first share of each run."""
    runs = []
    for run in problem.runs:
        # poses are told from the anchor on, and a run has an interval
        size = min(max(math.ceil(share * run.times.size), run.anchor + 1, 2), run.times.size)
        runs.append(replace(run, times=run.times[:size], data=run.data[:size]))
    return problem.changed(runs=runs)


def _costs(simulator: Simulator, theta: Vector, names: list[str]) -> dict[str, float]:
    """Run -> cost; nothing is simulated without names."""
    problem = simulator.problem
    found = simulator.residuals(theta, names)
    return {n: _cost(problem, theta, r, concerned(problem, [n])) for n, r in found}


def _cost(problem: Problem, theta: Vector, residual: Vector, own: list[int]) -> float:
    total = loss_for(problem.unstable).cost(residual)
    for i in own:
        p = problem.parameters[i]
        if p.prior:
            total += 0.5 * float((theta[i] - p.nominal) / p.prior) ** 2
    return total


def _step(
    problem: Problem, theta: Vector, residual: Vector, item: Sensitivity, own: list[int]
) -> Vector:
    place = [item.columns.tolist().index(i) for i in own]
    scale = problem.scale[own]
    good = np.isfinite(residual) & np.isfinite(item.values[:, :, place]).all(axis=2)
    slope = item.values[:, :, place][good] * scale
    weighted = slope * loss_for(problem.unstable).weight(residual)[good][:, None]
    matrix = weighted.T @ slope + 1e-9 * np.eye(len(own))
    gradient = weighted.T @ residual[good]
    for row, i in enumerate(own):
        p: Any = problem.parameters[i]
        if p.prior:
            ratio = scale[row] / p.prior
            matrix[row, row] += ratio**2
            gradient[row] -= ratio * float(theta[i] - p.nominal) / p.prior
    return np.asarray(np.linalg.solve(matrix, gradient) * scale)
