"""Values that concern one run only, fitted with everything else held.

A start pose is known to a millimetre and a few milliradians; a run that was not used for fitting
must have it estimated before its residual says anything about the model.

    min  sum over the run's samples of ((measured - model) / sigma)^2 + ((p - nominal) / prior)^2

by Gauss-Newton steps with one Jacobian per run: these values move the model almost linearly.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .parts import Sensitivity
from .problem import Problem

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
ENOUGH = 0.1
"""Fall of the cost [nats] below which a run is settled: far below anything that is decided."""


def concerned(problem: Problem, runs: Iterable[str]) -> list[int]:
    """Indices of the parameters that belong to one of these runs alone."""
    names = set(runs)
    return [i for i, p in enumerate(problem.parameters) if p.run in names]


def slopes(problem: Problem, theta: Vector, runs: Iterable[str]) -> dict[str, Sensitivity]:
    """Derivatives with respect to the runs' own parameters, by run."""
    names = list(runs)
    columns = concerned(problem, names)
    found = problem.jacobian(theta, names, columns=columns, central=False, relative=STEP)
    return {item.run: item for item in found}


def settled(
    problem: Problem,
    theta: Vector,
    runs: Iterable[str],
    known: dict[str, Sensitivity] | None = None,
) -> Vector:
    """Parameters with the runs' own values fitted to each of them.

    Args:
        problem: system and data.
        theta: all values; those of other runs and common ones stay.
        runs: names.
        known: derivatives from `slopes`, taken here if not given. They need not be of this theta.
    """
    names = list(runs)
    columns = concerned(problem, names)
    theta = theta.copy()
    if not columns:
        return theta
    if known is None:
        known = slopes(problem, theta, names)
    own = {name: [i for i in columns if problem.parameters[i].run == name] for name in names}
    costs: dict[str, float] = {}
    length = dict.fromkeys(names, 1.0)
    best, open_runs = theta.copy(), [name for name in names if own[name]]
    for _ in range(STEPS):
        going: list[str] = []
        for name, residual in problem.residuals(theta, open_runs):
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


def released(problem: Problem, theta: Vector) -> tuple[Problem, Vector, float]:
    """Estimate the late parameters of every run, with its other own values.

    Such values may move the model far from linearly, start angles of casters for instance, which
    turn over after an unstable moment. In a joint fit one such run would hold up all parameters;
    run by run, with steps that are shortened until they help, it harms none. The beginnings of the
    runs come first (see `HORIZONS`).

    Returns:
        The problem with these parameters held at what was found, all its values, and the fall of
        the cost [nats].
    """
    known = {run.name: run.starts for run in problem.runs}
    start = [
        next((known[p.run][n] / f for n, f in p.targets if n in known[p.run]), p.nominal)
        for p in problem.late
    ]
    whole = problem.with_parameters([*problem.parameters, *problem.late])
    names = [run.name for run in problem.runs]
    first = np.clip(np.concatenate([theta, start]), whole.lower, whole.upper)
    before = _costs(whole, first, names)
    values = first
    for share in HORIZONS:
        part = _beginnings(whole, share)
        begun = cost = _costs(part, values, names)
        for _ in range(RELEASES):
            values = settled(part, values, names)
            after = _costs(part, values, names)
            if not after < cost - RELEASED * begun:
                break
            cost = after
        part.close()
    whole.close()
    kept = dict(zip((p.name for p in problem.late), values[theta.size :].tolist(), strict=True))
    return whole.hold(kept), values[: theta.size], before - after


def _beginnings(problem: Problem, share: float) -> Problem:
    """The problem with only the first share of each run."""
    runs = []
    for run in problem.runs:
        size = math.ceil(share * run.times.size)
        runs.append(replace(run, times=run.times[:size], data=run.data[:size]))
    return problem._with(runs=runs)


def _costs(problem: Problem, theta: Vector, names: list[str]) -> float:
    own = {name: concerned(problem, [name]) for name in names}
    return sum(_cost(problem, theta, r, own[name]) for name, r in problem.residuals(theta, names))


def _cost(problem: Problem, theta: Vector, residual: Vector, own: list[int]) -> float:
    total = 0.5 * float(np.nansum(residual**2))
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
    matrix = slope.T @ slope + 1e-9 * np.eye(len(own))
    gradient = slope.T @ residual[good]
    for row, i in enumerate(own):
        p: Any = problem.parameters[i]
        if p.prior:
            ratio = scale[row] / p.prior
            matrix[row, row] += ratio**2
            gradient[row] -= ratio * float(theta[i] - p.nominal) / p.prior
    return np.asarray(np.linalg.solve(matrix, gradient) * scale)
