"""Where a fit begins in a strength of which first orders ask for too little."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..calibrate.problem import Problem
from ..errors import CosimError
from .models import GATE

Vector = NDArray[np.float64]
DOUBLINGS = 6
"""Times at most that a strength to begin with is doubled, from the usual one up and down."""


def doubled(
    cost_at: Callable[[Vector], float],
    problem: Problem,
    theta: Vector,
    cost: float,
    name: str,
    usual: float = 0.0,
) -> Vector:
    """A place to begin with a larger strength, as long as that is better.

    First orders ask for too little of what shifts oscillations, such as play, and a little of it
    may do more harm than none: up to the usual strength all are tried.

    Args:
        cost_at: of the parameters; raises CosimError where they cannot be simulated.
        problem: to fit.
        theta: where to begin else.
        cost: there.
        name: of the strength.
        usual: where it is, 0 if the first order holds.
    """
    place = problem.index(name)
    low, high = problem.lower[place], problem.upper[place]
    trial, best = theta.copy(), theta
    least = 0.5**DOUBLINGS * usual
    for _ in range(2 * DOUBLINGS):
        size = 2.0 * trial[place]
        trial = trial.copy()
        trial[place] = np.clip(max(size, least) if size >= 0.0 else size, low, high)
        try:
            now = cost_at(trial)
        except CosimError:
            break
        if now < cost - GATE:
            best, cost = trial, now
        elif abs(trial[place]) >= usual:
            break
    return best
