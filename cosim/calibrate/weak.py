"""What the data say along directions that they know poorly, measured by steps that are seen.

Differences over small steps of a model with friction are rounded by the ticks at which it sticks,
and that looks like information on combinations that change nothing (all torques and inertias by the
same factor).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import FmuCallError
from .descent import Descent
from .felt import LONGEST
from .normal import KNOWN, gradient

Vector = NDArray[np.float64]
WEAK = 1e-3
"""Share of the best known direction's information up to which a direction is measured again."""
SHORT = 0.01
"""Spans that the bounds must leave of the longest step, with which that is done."""
CLEAR = 10.0
"""Times as much information as on a direction that others must have to be kept apart from it."""


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
    common = np.array([not item.run for item in run.problem.parameters])
    found, turned = np.full(values.size, np.inf), vectors.copy()
    for i in np.flatnonzero((values >= 1.0 / KNOWN**2) & (values < WEAK * values.max())):
        if float(np.sum(vectors[common, i] ** 2)) < 0.5:
            continue
        seen = _seen(run, vectors[:, i], values, vectors, values > CLEAR * values[i])
        if seen is not None:
            found[i], turned[:, i] = seen
    return found, turned


def _seen(
    run: Descent, direction: Vector, values: Vector, vectors: Vector, better: NDArray[np.bool_]
) -> tuple[float, Vector] | None:
    """Information along a direction from long steps, and the direction, turned back.

    Args:
        run: its residuals are those at theta.
        direction: in spans.
        values, vectors: of the normal matrix.
        better: which of these directions are known too well to be mixed with this one.

    Returns:
        None where bounds leave no room, or nothing can be simulated.
    """
    p = run.problem

    def along(residuals: list[tuple[str, Vector]]) -> Vector:
        return np.asarray(vectors.T @ gradient(p, run.theta, run.jacobian, residuals))

    here = along(run.residuals)
    seen: list[tuple[float, Vector]] = []
    for sign in (1.0, -1.0):
        way = sign * direction * p.scale
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(way > 0, p.upper - run.theta, p.lower - run.theta) / way
        length = min(LONGEST, float(np.nanmin(np.where(way == 0.0, np.inf, room))))
        if length < SHORT:
            continue
        try:
            there = np.clip(run.theta + length * way, p.lower, p.upper)
            moved = run.simulator.residuals(there, run.purpose)
        except FmuCallError:
            continue
        pairs = zip(moved, run.residuals, strict=True)
        square = sum(float(np.nansum((a - b) ** 2)) for (_, a), (_, b) in pairs)
        undone = along(moved) - here
        square -= float(np.sum(undone[better] ** 2 / values[better]))
        drawn = sum(
            (length * way[k] / item.prior) ** 2
            for k, item in enumerate(p.parameters) if item.prior
        )  # fmt: skip
        back = vectors[:, better] @ (undone[better] / values[better]) / (sign * length)
        seen.append(((max(square, 0.0) + drawn) / length**2, direction + back))
    return min(seen, key=lambda item: item[0]) if seen else None
