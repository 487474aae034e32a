"""What a fitted model foretells of runs that it was not fitted to, as well as it can."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .estimate import Estimate

Vector = NDArray[np.float64]
LEAST = 0.01
"""Share of a deviation that bounds must leave: of less, what a solver's tolerance leaves shows."""


def foretold(
    estimate: Estimate, residuals: Sequence[tuple[str, Vector]]
) -> list[tuple[str, Vector]]:
    """Residuals of runs that were not fitted, white of what the parameters' deviations add.

        C^(-1/2) r,    C = 1 + D D'

    The columns of D are what the model changes by, over the noise, one standard deviation along
    each main direction of the parameters' covariance: a model that is right is off by so much
    there, and in what a run magnifies (a pendulum that goes over the top) by many times its noise.

    Args:
        estimate: of the fit.
        residuals: by run, over the noise, one row per sample; gaps are NaN.

    Raises:
        CosimError: it cannot be simulated beside its parameters.
    """
    if not residuals:
        return []
    names = [name for name, _ in residuals]
    good = [np.isfinite(rows).ravel() for _, rows in residuals]

    def stacked(items: Sequence[tuple[str, Vector]]) -> Vector:
        pairs = zip(items, good, strict=True)
        return np.concatenate([np.nan_to_num(rows.ravel()[kept]) for (_, rows), kept in pairs])

    here = stacked(estimate.simulator.residuals(estimate.theta, names))
    changes = [
        (stacked(estimate.simulator.residuals(estimate.theta + step, names)) - here) * times
        for step, times in _deviations(estimate, names)
    ]
    whole = stacked(residuals)
    if changes:
        ways, sizes, _ = np.linalg.svd(np.column_stack(changes), full_matrices=False)
        whole = whole - ways @ ((1.0 - 1.0 / np.sqrt(1.0 + sizes**2)) * (ways.T @ whole))
    found, place = [], 0
    for (name, rows), kept in zip(residuals, good, strict=True):
        full, count = np.full(kept.size, np.nan), int(kept.sum())
        full[kept] = whole[place : place + count]
        found.append((name, full.reshape(rows.shape)))
        place += count
    return found


def _deviations(estimate: Estimate, names: Sequence[str]) -> list[tuple[Vector, float]]:
    """Deviations along main directions, shorter where a bound is near, and how often they count."""
    problem, theta = estimate.problem, estimate.theta
    concerned = [k for k, p in enumerate(problem.parameters) if not p.run or p.run in names]
    scale = problem.scale[concerned]
    inner = estimate.covariance[np.ix_(concerned, concerned)] / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(inner)
    found = []
    for value, vector in zip(values, vectors.T, strict=True):
        way = np.zeros(theta.size)
        way[concerned] = np.sqrt(max(float(value), 0.0)) * vector * scale
        rooms = []
        for sign in (1.0, -1.0):
            with np.errstate(divide="ignore", invalid="ignore"):
                room = np.where(sign * way > 0.0, problem.upper - theta, problem.lower - theta)
                rooms.append(float(np.nanmin(np.where(way == 0.0, np.inf, room / (sign * way)))))
        side = int(rooms[1] > rooms[0])
        share = min(rooms[side], 1.0)
        if share > LEAST and np.any(way):
            found.append(((1.0, -1.0)[side] * share * way, 1.0 / share))
    return found


def within_intervals(channel: str, size: float) -> str:
    """What is said of a channel that is off by no more than that in runs that were not fitted.

    Args:
        channel: its name.
        size: of its residual over the noise.
    """
    return (
        f"in runs that were not fitted {channel} is off by {size:.3g} times its noise, which is no "
        "more than the intervals of the parameters make of it there: fit such a run, too, and the "
        "parameters are better known"
    )
