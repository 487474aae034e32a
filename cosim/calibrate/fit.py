"""Bounded weighted least squares over all identification runs."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import ScenarioError
from .descent import EVEN, STEPS, Descent
from .estimate import Estimate, estimated
from .known import Known
from .loss import Huber, Squares, loss_for
from .memory import give_back
from .parts import PURPOSE
from .simulator import Simulator

Vector = NDArray[np.float64]
APART = 10.0
"""Runs are fitted one half after the other if their mean errors differ by more than this factor."""
RETURNS = 3
"""Times that a fit goes on from a lower point that its intervals have met; each costs as many
simulations as intervals do, and what still falls then has a floor that is flat for a reason."""


@dataclass(frozen=True)
class Effort:
    """How far a fit is from its minimum when it begins, and how near it must come.

    Attributes:
        begin: `far`: large residuals count linearly at first, the calmest runs lead; `near`: they
            count in full; `there`: but for small corrections, by steps with one Jacobian.
        end: `draft`: the minimum roughly, for comparison or another fit, no intervals; `minimum`:
            as near as others come to it, no intervals; `intervals`: derivatives good enough for
            these; `polished`: after steps with derivatives taken there, too, which `there` begins
            with.
        iterations: at each size of difference steps at most, or with known derivatives.
        share: of the cost beyond the noise's, below which a fall ends a fit with known derivatives.
    """

    begin: Literal["far", "near", "there"] = "far"
    end: Literal["draft", "minimum", "intervals", "polished"] = "polished"
    iterations: int = 25
    share: float = EVEN


THOROUGH = Effort()
"""From the nominal values to the minimum, with intervals."""
INTERVALS = Effort("near", "intervals", iterations=0)
"""Stays where it begins and says what the data know there."""
POLISH = Effort("near", iterations=0)
"""The last steps alone."""
CORRECTION = Effort("there", "intervals")
"""Steps from close by, with intervals."""
MINIMUM = Effort("there", "minimum")
"""The same to be compared with what is nearly as good."""
DRAFT = Effort("there", "draft")
"""The same to be compared with what is not: one-sided derivatives."""


def fit(
    simulator: Simulator,
    theta: Vector | None = None,
    purpose: str | Iterable[str] = PURPOSE,
    *,
    effort: Effort = THOROUGH,
    known: Known | None = None,
    goal: float = math.inf,
) -> Estimate:
    """Estimate the parameters of a problem.

    Near the solution, residuals that are far off count less (`loss.loss_for`).

    Args:
        simulator: of the problem.
        theta: where to begin, the nominal values if not given.
        purpose: runs to fit.
        effort: how far away that is, and how near the minimum must be reached.
        known: derivatives of a fit with nearly the same parameters, which stand for those at
            `theta`; a quick fit, whose intervals are as good as they are.
        goal: see `Descent.correct`; of fits that begin `there`.

    Raises:
        ScenarioError: the problem has no parameter.
        FmuCallError: it cannot be simulated where the fit begins.
    """
    found = _fitted(simulator, theta, purpose, effort, known, goal)
    give_back()
    return found


def _fitted(
    simulator: Simulator,
    theta: Vector | None,
    purpose: str | Iterable[str],
    effort: Effort,
    known: Known | None,
    goal: float,
) -> Estimate:
    begun, problem = simulator.evaluations, simulator.problem
    if not problem.parameters:
        raise ScenarioError(
            f"{problem.name}: no parameter is open, so there is nothing to fit; give one with "
            "[[parameter]] in the mapping (of what is known well, with narrow bounds)"
        )
    run = Descent(
        simulator, purpose, problem.nominal if theta is None else theta.astype(np.float64)
    )
    if effort.begin == "there" or known is not None:
        run.count(loss_for(problem.unstable, run.residuals))
    if known is not None:
        run.follow(known, effort.iterations, effort.share)
        return estimated(run)
    draft = effort.end == "draft"
    if effort.begin == "there":
        run.correct(draft=draft, goal=goal)
        return estimated(run) if effort.end in ("draft", "minimum") else _confirmed(run)
    if effort.begin == "far" and _uneven(run):
        run = Descent(simulator, _calmest(run), run.theta)
        sizes = np.concatenate([r[np.isfinite(r)] for _, r in run.residuals])
        typical = float(np.median(np.abs(sizes))) if sizes.size else 1.0
        run.count(Huber(max(3.0, typical)))
        run.descend(STEPS[0], 3, 0.05)
        run.count(Huber(3.0))
        run.descend(STEPS[1], 3, 0.01)
        run = Descent(simulator, purpose, run.theta, begun)
        run.count(Huber(3.0))
        run.descend(STEPS[1], 4, 0.01)
        run.count(Squares())
    run.descend(STEPS[1], effort.iterations, 5e-3 if draft else 1e-4)
    run.count(loss_for(problem.unstable, run.residuals))
    if effort.end == "polished":
        run.correct()
    elif effort.end == "intervals":
        run.normal(STEPS[-1], central=True)
    return estimated(run) if draft else _confirmed(run, stays=effort.end == "intervals")


def _confirmed(run: Descent, *, stays: bool = False) -> Estimate:
    """Intervals, with long steps along what is known poorly.

    They are those of a minimum: where such a step comes to a lower point, the fit goes on there,
    unless it `stays`.
    """
    run.smooth()
    for _ in range(RETURNS):
        found = estimated(run, confirm=True)
        if stays or not run.lowered():
            return found
        run.correct()
        run.smooth()
    return estimated(run, confirm=True)


def _uneven(run: Descent) -> bool:
    """Whether some runs are much farther off than others."""
    sizes = [size for size, _ in _sizes(run)]
    return bool(sizes) and max(sizes) > APART * max(min(sizes), 1.0)


def _calmest(run: Descent) -> list[str]:
    """The half of the runs that fit best so far: those without limits and runaway errors."""
    worth = sorted(_sizes(run))
    return [name for _, name in worth[: max((len(worth) + 1) // 2, 1)]]


def _sizes(run: Descent) -> list[tuple[float, str]]:
    """Mean residual and name of the runs in which something is measured."""
    return [
        (float(np.nanmean(np.minimum(np.abs(r), 1e6))), name)
        for name, r in run.residuals if np.isfinite(r).any()
    ]  # fmt: skip
