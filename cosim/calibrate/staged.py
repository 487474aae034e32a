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
from .fit import DRAFT, fit
from .known import Known
from .loss import loss_for, mean_squares
from .nuisance import released, starts
from .parts import PURPOSE
from .simulator import Simulator

Vector = NDArray[np.float64]
PASSES, PAYS = 4, 0.1
"""Fits of the calmer half at most, and the share of the cost beyond noise that one must remove to
be followed by another."""
LEFT, LEAST = 25.0, 0.1
"""Mean square of a window over the noise's from which a model has left a run, and the share of a
run that is fitted at least."""
ADVANCES, FARTHER = 6, 1.02
"""Fits of what the model has not left at most, and the factor by which each must reach farther."""


def staged(simulator: Simulator, theta: Vector, purpose: str = PURPOSE) -> tuple[Simulator, Vector]:
    """The calmer half of the runs fitted, late values estimated in all, nothing fitted to all yet.

    Args:
        simulator: of a problem with late parameters.
        theta: a fit of all runs.
        purpose: runs to fit.

    Returns:
        Of the problem with late values held, and its parameters.
    """
    problem = simulator.problem
    costs, loss = [], loss_for(problem.unstable)
    for name, residual in simulator.residuals(theta, purpose):
        count = int(np.isfinite(residual).sum())
        costs.append((loss.cost(residual) / max(count, 1), name))
    calm = [name for _, name in sorted(costs)[: (len(costs) + 1) // 2]]
    part = simulator.of(problem.only(calm))
    names = part.problem.names
    values = theta[[problem.index(name) for name in names]]
    before = np.inf
    for _ in range(PASSES):
        part, values, _ = released(part, values)
        found = fit(part, values, calm, effort=DRAFT)
        values = found.theta
        beyond = found.robust - 0.5 * found.count
        if not beyond < (1.0 - PAYS) * before:
            break
        before = beyond
    theta = theta.copy()
    theta[[problem.index(name) for name in names]] = values
    runs = [part.problem.run(run.name) if run.name in calm else run for run in problem.runs]
    whole, theta = _advanced(simulator.of(problem.changed(runs=runs)), theta, purpose)
    whole, theta, _ = released(whole, theta)
    return whole, theta


def _advanced(simulator: Simulator, theta: Vector, purpose: str) -> tuple[Simulator, Vector]:
    """All runs fitted up to where the model leaves them, as long as that gets farther."""
    before = 0
    for _ in range(ADVANCES):
        part, late, _ = released(_cut(simulator, theta, purpose, LEAST), theta)
        simulator = _begun(simulator, part)
        part = _cut(simulator, late, purpose)
        count = sum(run.times.size for run in part.problem.chosen(purpose))
        if count < FARTHER * before:
            break
        try:
            part, theta, _ = jointly(part, late, purpose)
        except FmuCallError:  # too steep for derivatives: what follows begins here
            break
        simulator, before = _begun(simulator, part), count
        if count == sum(run.times.size for run in simulator.problem.chosen(purpose)):
            break
    return simulator, theta


def jointly(
    simulator: Simulator, theta: Vector, purpose: str = PURPOSE
) -> tuple[Simulator, Vector, Known]:
    """All parameters fitted together with late values: in turn they would hold each other up.

    Returns:
        Of the problem with late values held at what was found, its parameters, and derivatives
        there.
    """
    problem = simulator.problem
    names = {run.name for run in problem.chosen(purpose)}
    late = [p for p in problem.late if p.run in names]
    whole = problem.with_parameters([*problem.parameters, *late])
    known = dict(zip((p.name for p in problem.late), starts(problem), strict=True))
    begun = np.concatenate([theta, [known[p.name] for p in late]])
    begun = np.clip(begun, whole.lower, whole.upper)
    found = fit(simulator.of(whole), begun, purpose, effort=DRAFT)
    held = whole.hold({p.name: found.values[p.name] for p in late})
    return simulator.of(held), found.theta[: theta.size], found.known


def _begun(simulator: Simulator, other: Simulator) -> Simulator:
    """Of a problem whose runs begin as those of another one."""
    problem = simulator.problem
    runs = [replace(run, starts=other.problem.run(run.name).starts) for run in problem.runs]
    return simulator.of(problem.changed(runs=runs))


def _cut(simulator: Simulator, theta: Vector, purpose: str, most: float = 1.0) -> Simulator:
    """Of the problem with runs that end where the model has left them."""
    sizes = {}
    for name, residual in simulator.residuals(theta, purpose):
        gone = np.flatnonzero(np.any(mean_squares(residual) > LEFT, axis=1))
        count = len(residual)
        first = int(gone[0]) if gone.size else count
        least = max(math.ceil(LEAST * count), simulator.problem.run(name).anchor + 1)
        sizes[name] = max(min(first, math.ceil(most * count)), least)
    problem = simulator.problem
    cut = [
        replace(run, times=run.times[: sizes[run.name]], data=run.data[: sizes[run.name]])
        if run.name in sizes else run
        for run in problem.runs
    ]  # fmt: skip
    return simulator.of(problem.changed(runs=cut))
