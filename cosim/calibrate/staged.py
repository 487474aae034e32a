"""A fit that goes from the runs that a model nearly explains to those that turn unstable.

With dry friction the start angles of casters decide when they turn over, and a joint fit of all
runs is held up by those in which that happens at the wrong moment: parameters stand where it
happens to come right. So the calmer half of the runs is fitted first, with its late values; the
others get theirs from the parameters that are known then, and all are fitted up to where the model
leaves them. What comes after a caster has turned over at the wrong moment is steep in parameters
that only these runs tell (the acceleration limit), and would hold them where they are. A joint fit
can begin when that reaches no farther.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..errors import FmuCallError
from .fit import PURPOSE, Known, fit
from .loss import loss_for, mean_squares
from .nuisance import released, starts
from .problem import Problem

Vector = NDArray[np.float64]
PASSES, PAYS = 4, 0.1
"""Fits of the calmer half at most, and the share of the cost beyond noise that one must remove to
be followed by another."""
LEFT, LEAST = 25.0, 0.1
"""Mean square of a window over the noise's from which a model has left a run, and the share of a
run that is fitted at least."""
ADVANCES, FARTHER = 6, 1.02
"""Fits of what the model has not left at most, and the factor by which each must reach farther."""


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
    runs = [part.run(run.name) if run.name in calm else run for run in problem.runs]
    whole = problem._with(runs=runs)
    whole.limits = limits
    whole, theta = _advanced(whole, theta, purpose)
    whole, theta, _ = released(whole, theta)
    whole.limits = limits
    return whole, theta


def _advanced(problem: Problem, theta: Vector, purpose: str) -> tuple[Problem, Vector]:
    """All runs fitted up to where the model leaves them, as long as that gets farther."""
    limits, before = problem.limits, 0
    for _ in range(ADVANCES):
        part, late, _ = released(_cut(problem, theta, purpose, LEAST), theta)
        problem = _begun(problem, part)
        part = _cut(problem, late, purpose)
        part.limits = limits
        count = sum(run.times.size for run in part.chosen(purpose))
        if count < FARTHER * before:
            break
        try:
            part, theta, _ = jointly(part, late, purpose)
        except FmuCallError:  # too steep for derivatives: what follows begins here
            break
        problem, before = _begun(problem, part), count
        if count == sum(run.times.size for run in problem.chosen(purpose)):
            break
    return problem, theta


def jointly(
    problem: Problem, theta: Vector, purpose: str = PURPOSE
) -> tuple[Problem, Vector, Known]:
    """All parameters fitted together with late values: in turn they would hold each other up.

    Returns:
        The problem with late values held at what was found, its parameters, and derivatives there.
    """
    names = {run.name for run in problem.chosen(purpose)}
    late = [p for p in problem.late if p.run in names]
    whole = problem.with_parameters([*problem.parameters, *late])
    whole.limits = problem.limits
    known = dict(zip((p.name for p in problem.late), starts(problem), strict=True))
    begun = np.concatenate([theta, [known[p.name] for p in late]])
    found = fit(whole, np.clip(begun, whole.lower, whole.upper), purpose, near=True, draft=True)
    held = whole.hold({p.name: found.values[p.name] for p in late})
    held.limits = problem.limits
    return held, found.theta[: theta.size], Known.of(found)


def _begun(problem: Problem, other: Problem) -> Problem:
    """A problem whose runs begin as those of another one."""
    runs = [replace(run, starts=other.run(run.name).starts) for run in problem.runs]
    changed = problem._with(runs=runs)
    changed.limits = problem.limits
    return changed


def _cut(problem: Problem, theta: Vector, purpose: str, most: float = 1.0) -> Problem:
    """The problem with runs that end where the model has left them."""
    sizes = {}
    for name, residual in problem.residuals(theta, purpose):
        gone = np.flatnonzero(np.any(mean_squares(residual) > LEFT, axis=1))
        count = len(residual)
        first = int(gone[0]) if gone.size else count
        sizes[name] = max(min(first, math.ceil(most * count)), math.ceil(LEAST * count))
    cut = [
        replace(run, times=run.times[: sizes[run.name]], data=run.data[: sizes[run.name]])
        if run.name in sizes else run
        for run in problem.runs
    ]  # fmt: skip
    part = problem._with(runs=cut)
    part.limits = problem.limits
    return part
