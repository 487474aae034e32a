"""Intervals that the others make up for: a parameter is moved, and the rest of the model follows.

The normal equations know directions in which nothing changes only as well as their derivatives are;
beside parameters that are known a million times better, that is not well enough.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..errors import FmuCallError
from .broyden import Broyden
from .descent import Descent
from .felt import STUCK
from .making_up import LOST, made_up, undone
from .normal import KNOWN
from .problem import Problem

Vector = NDArray[np.float64]
HEAVY = 0.3
"""Weight in a weak direction from which a parameter is moved by itself."""
FAR = 1.0
"""Spans by which that is done at most."""
CLAIMED, SURE, SEEN = 4.0, 0.5, 8.0
"""Standard deviations by which it is done first, the share of the information claimed that settles
it, and the rise of the cost [nats] at which it has gone far enough."""
SHARED = 0.1
"""Share of a step [spans] from which a parameter takes part in it."""


def profiled(run: Descent, covariance: Vector, weak: Vector) -> Vector:
    """A covariance, widened where a parameter can be moved far and the others make up for that.

    Several weak directions at once are mixed by rounded derivatives, and none of them is then the
    one along which nothing changes; a parameter that is held elsewhere finds it. It is moved by
    what its interval allows, and twice as far, as long as that costs less than it should: each
    stretch of such a valley shows better where it goes on.

    Args:
        run: at its minimum.
        covariance: in spans.
        weak: directions (columns); parameters with a share in one are moved, but for those of runs.
    """
    covariance = covariance.copy()
    common = np.array([not item.run for item in run.problem.parameters])
    silent = run.drawn & (np.diag(covariance) > KNOWN**2)
    moved = np.flatnonzero((np.any(np.abs(weak) > HEAVY, axis=1) & common) | silent)
    for k in sorted(moved.tolist(), key=lambda k: -covariance[k, k]):
        claimed = math.sqrt(covariance[k, k])
        if silent[k]:  # open up to the bound, which is two deviations away
            told, way = (2.0 / _room(run, k)[1]) ** 2, covariance[:, k] / covariance[k, k]
        elif claimed > KNOWN:
            continue
        elif (found := _followed(run, k, claimed)) is not None:
            told, way = found
        else:
            continue
        more = 1.0 / told - covariance[k, k]
        if more > 0.0:
            covariance += more * np.outer(way, way)
    return covariance


def _room(run: Descent, k: int) -> tuple[float, float]:
    """Towards which bound a parameter has more room, and how much [spans]."""
    p = run.problem
    above, below = (np.array([p.upper - run.theta, run.theta - p.lower]) / p.scale)[:, k]
    return (1.0 if above >= below else -1.0), min(FAR, max(above, below))


def _followed(run: Descent, k: int, claimed: float) -> tuple[float, Vector] | None:
    """Information on a parameter when the others make up for it, and how they do [spans].

    What a step of any length costs (up to `STUCK`) is no information: it is read from steps of two
    lengths.

    Args:
        run: at its minimum.
        k: the parameter.
        claimed: its standard deviation according to the derivatives there [spans].

    Returns:
        None where it cannot be moved, or has been found as well known as claimed.
    """
    p = run.problem
    stuck = STUCK**2 * sum(np.isfinite(r).sum() for _, r in run.residuals)
    side, room = _room(run, k)
    slopes = Broyden(p, run.jacobian, run.loss)
    matrix = slopes.normal(run.theta, run.residuals).matrix
    way = -undone(matrix, matrix[:, k], k)
    way[k] = 1.0
    length, before = min(0.5 * CLAIMED * claimed, room), math.nan
    told, best = math.inf, way
    while True:
        try:
            theta, rise = made_up(run, slopes, k, side * length * way)
        except FmuCallError:
            break
        if rise > LOST:
            break
        way = (theta - run.theta) / (side * length * p.scale)
        if math.isfinite(before):
            floor = min(max((4.0 * before - rise) / 3.0, 0.0), stuck)
            # where nothing is told it may be anywhere up to the bound, two deviations away
            told = max(2.0 * max(rise - floor, 0.0), 4.0) / length**2
            best = way
            if told > SURE / claimed**2 or rise - floor > SEEN:
                break
        room = min(room, stretch(p, run.theta, side * way))
        if length >= room:
            break
        before, length = rise, min(2.0 * length, room)
    return (told, best) if told < SURE / claimed**2 else None


def stretch(problem: Problem, theta: Vector, way: Vector) -> float:
    """How far a direction goes until a parameter that it moves meets its bound [spans]."""
    with np.errstate(divide="ignore", invalid="ignore"):
        rooms = np.where(way > 0.0, problem.upper - theta, problem.lower - theta)
        rooms /= way * problem.scale
    return float(np.min(rooms, where=np.abs(way) > SHARED, initial=np.inf))
