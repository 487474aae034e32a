"""A fit that goes from the runs that a model nearly explains to those that turn unstable.

With dry friction the start angles of casters decide when they turn over, and a joint fit of all
runs is held up by those in which that happens at the wrong moment: parameters stand where it
happens to come right. So the calmer half of the runs is fitted first, with its late values; the
others get theirs from the parameters that are known then, and a joint fit can begin.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .fit import PURPOSE, fit
from .loss import loss_for
from .nuisance import released
from .problem import Problem

Vector = NDArray[np.float64]
PASSES, PAYS = 4, 0.1
"""Fits of the calmer half at most, and the share of the cost beyond noise that one must remove to
be followed by another."""


def staged(problem: Problem, theta: Vector, purpose: str = PURPOSE) -> tuple[Problem, Vector]:
    """The calmer half of the runs fitted, late values estimated in all, nothing fitted to all yet.

    Args:
        problem: with late parameters.
        theta: a fit of all runs.
        purpose: runs to fit.

    Returns:
        The problem with late values held, and its parameters.
    """
    costs, loss = [], loss_for(problem.unstable)
    for name, residual in problem.residuals(theta, purpose):
        count = int(np.isfinite(residual).sum())
        costs.append((loss.cost(residual) / max(count, 1), name))
    calm = [name for _, name in sorted(costs)[: (len(costs) + 1) // 2]]
    part = problem.only(calm)
    limits = part.limits = problem.limits
    values = theta[[problem.index(name) for name in part.names]]
    before = np.inf
    for _ in range(PASSES):
        part, values, _ = released(part, values)
        part.limits = limits
        found = fit(part, values, calm, near=True, draft=True)
        values = found.theta
        beyond = found.robust - 0.5 * found.count
        if not beyond < (1.0 - PAYS) * before:
            break
        before = beyond
    theta = theta.copy()
    theta[[problem.index(name) for name in part.names]] = values
    part.close()
    runs = [part.run(run.name) if run.name in calm else run for run in problem.runs]
    whole = problem._with(runs=runs)
    whole.limits = limits
    whole, theta, _ = released(whole, theta)
    whole.limits = limits
    return whole, theta
