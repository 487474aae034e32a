"""What the data say along directions that they know poorly, measured by steps that are seen.

Differences over small steps of a model with friction are rounded by the ticks at which it sticks,
and that looks like information on combinations that change nothing (all torques and inertias by the
same factor).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import FmuCallError
from .normal import Normal, gradient

if TYPE_CHECKING:
    from .fit import Descent

Vector = NDArray[np.float64]
KNOWN = 0.25
"""A combination is identifiable if its standard deviation is below this fraction of the span."""
WEAK = 1e-3
"""Share of the best known direction's information up to which a direction is measured again."""
LONG, SHORT = 0.1, 0.01
"""Spans of the step with which that is done, and the least that the bounds must leave."""
CLEAR = 10.0
"""Times as much information as on a direction that others must have to be kept apart from it."""
HEAVY = 0.3
"""Weight in a weak direction from which a parameter is moved by itself."""
FAR, FOLLOWED, SLIGHT = 1.0, 6, 0.5
"""Spans by which that is done, steps at most of the others, and the fall [nats] that ends them."""
STUCK = 0.05
"""RMS over the noise of the differences between models that stick at other ticks."""
PARTS = (1.0, 0.3)
"""Shares of a step that are tried."""


def confirmed(run: Descent, values: Vector, vectors: Vector) -> tuple[Vector, Vector]:
    """Information on the weak directions, from steps large enough to be seen if they change much.

    Differences over small steps of a model with friction are rounded by the ticks at which it
    sticks, and that looks like information on combinations that change nothing (all torques and
    inertias by the same factor). The same rounding turns the direction a little, towards others
    that change a lot; what those could undo does not count.

    Args:
        run: its residuals are those at theta.
        values, vectors: of the normal matrix.

    Returns:
        one per direction, infinite where none was measured; and the directions, turned back to
        where the others undo nothing.
    """
    p = run.problem
    common = np.array([not item.run for item in p.parameters])
    found, turned = np.full(values.size, np.inf), vectors.copy()
    base = run.residuals

    def along(residuals: list[tuple[str, Vector]]) -> Vector:
        return np.asarray(vectors.T @ gradient(p, run.theta, run.jacobian, residuals))

    here = along(base)
    for i in np.flatnonzero((values >= 1.0 / KNOWN**2) & (values < WEAK * values.max())):
        direction = vectors[:, i]
        if float(np.sum(direction[common] ** 2)) < 0.5:
            continue
        better = values > CLEAR * values[i]
        seen: list[tuple[float, Vector]] = []
        for sign in (1.0, -1.0):
            way = sign * direction * p.scale
            with np.errstate(divide="ignore", invalid="ignore"):
                room = np.where(way > 0, p.upper - run.theta, p.lower - run.theta) / way
            length = min(LONG, float(np.nanmin(np.where(way == 0.0, np.inf, room))))
            if length < SHORT:
                continue
            try:
                there = np.clip(run.theta + length * way, p.lower, p.upper)
                moved = p.residuals(there, run.purpose)
            except FmuCallError:
                continue
            pairs = zip(moved, base, strict=True)
            square = sum(float(np.nansum((a - b) ** 2)) for (_, a), (_, b) in pairs)
            undone = along(moved) - here
            square -= float(np.sum(undone[better] ** 2 / values[better]))
            drawn = sum(
                (length * way[k] / item.prior) ** 2
                for k, item in enumerate(p.parameters) if item.prior
            )  # fmt: skip
            back = vectors[:, better] @ (undone[better] / values[better]) / (sign * length)
            seen.append(((max(square, 0.0) + drawn) / length**2, direction + back))
        if seen:
            found[i], turned[:, i] = min(seen, key=lambda item: item[0])
    return found, turned


def profiled(run: Descent, normal: Normal, covariance: Vector, weak: Vector) -> Vector:
    """A covariance, widened where a parameter can be moved far and the others make up for that.

    Several weak directions at once are mixed by rounded derivatives, and none of them is then the
    one along which nothing changes; a parameter that is held elsewhere finds it. What the data say
    is read from steps of two lengths: what a step of any length costs (up to `STUCK`) is no
    information.

    Args:
        run: at its minimum.
        normal: equations there.
        covariance: in spans.
        weak: directions (columns); parameters with a share in one are moved, but for those of runs.
    """
    p, covariance = run.problem, covariance.copy()
    stuck = STUCK**2 * sum(np.isfinite(r).sum() for _, r in run.residuals)
    common = np.array([not item.run for item in p.parameters])
    for k in np.flatnonzero(np.any(np.abs(weak) > HEAVY, axis=1) & common):
        if math.sqrt(covariance[k, k]) > KNOWN:
            continue
        above, below = (np.array([p.upper - run.theta, run.theta - p.lower]) / p.scale)[:, k]
        length = (1.0 if above >= below else -1.0) * min(FAR, max(above, below))
        others = np.flatnonzero(np.arange(run.theta.size) != k)
        inverse = np.linalg.pinv(normal.matrix[np.ix_(others, others)], 1e-12, hermitian=True)
        way = np.zeros(run.theta.size)
        way[k], rises = 1.0, []
        way[others] = -inverse @ normal.matrix[others, k]
        try:
            for size in (0.5 * length, length):
                theta = np.clip(run.theta + size * way * p.scale, p.lower, p.upper)
                residuals = p.residuals(theta, run.purpose)
                cost = run.total(theta, residuals)
                for _ in range(FOLLOWED):
                    step = np.zeros(run.theta.size)
                    wanted = gradient(p, theta, run.jacobian, residuals, run.loss)[others]
                    step[others] = inverse @ wanted
                    before = cost
                    for part in PARTS:
                        there = np.clip(theta + part * step * p.scale, p.lower, p.upper)
                        moved = p.residuals(there, run.purpose)
                        if (after := run.total(there, moved)) < cost:
                            theta, residuals, cost = there, moved, after
                            break
                    if before - cost < SLIGHT:
                        break
                rises.append(2.0 * (cost - run.cost))
                way = (theta - run.theta) / (size * p.scale)
        except FmuCallError:
            continue
        floor = min(max((4.0 * rises[0] - rises[1]) / 3.0, 0.0), stuck)
        told = max(rises[1] - floor, 0.0) / length**2
        # where nothing is told it may be anywhere up to the bound, two deviations away
        more = 1.0 / max(told, (2.0 / length) ** 2) - covariance[k, k]
        if more > 0.0:
            covariance += more * np.outer(way, way)
    return covariance
