"""Steps along products: what one parameter is changed by, another one makes up for.

A mass m at p shows as m and m p far more than as anything else, so fits go along the hyperbola
m p = const. A straight step leaves it by dm dp, which costs more than the step brings. Where a
parameter's hints say what it is multiplied with, its step is shortened or stretched instead,

    p_new = p + dp m/(m + dm),   so that   m_new p_new = m p + m dp + p dm

holds exactly: the product changes as the derivatives have it.

Source: Absil, Mahony, Sepulchre, Optimization Algorithms on Matrix Manifolds (2008), 4.1
(retractions).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .problem import Problem

Vector = NDArray[np.float64]
FARTHEST = 10.0
"""Factor by which a step is stretched or shortened at most: beyond, derivatives say nothing."""


def pairs(problem: Problem) -> list[tuple[int, int]]:
    """Places of the parameters that are multiplied with another one, and of that one."""
    places = {name: i for i, name in enumerate(problem.names)}
    found = []
    for i, p in enumerate(problem.parameters):
        other = f"{p.name.rpartition('.')[0]}.{p.hints.times}"
        if p.hints.times and other in places:
            found.append((i, places[other]))
    return found


def stepped(theta: Vector, change: Vector, products: list[tuple[int, int]]) -> Vector:
    """Parameters after a step, products changed as the derivatives have it.

    Args:
        theta: before.
        change: the straight step.
        products: see `pairs`.
    """
    found = np.asarray(theta + change)
    for one, other in products:
        before, after = float(theta[other]), float(found[other])
        if before * after > 0.0:  # a factor that vanishes or turns leaves no product to keep
            factor = min(max(before / after, 1.0 / FARTHEST), FARTHEST)
            found[one] = theta[one] + change[one] * factor
    return found
