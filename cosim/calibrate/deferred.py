"""Deferred correction: what a coarse communication step adds is taken from the data instead."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from .problem import Problem
from .simulator import Simulator

Vector = NDArray[np.float64]


def step_error(
    simulator: Simulator,
    theta: Vector,
    step: float,
    purpose: str | Iterable[str] | None = None,
) -> dict[str, Vector]:
    """What the exchange at communication points adds to the model values, by run.

    Where the rig has ticks, the problem's step is exact, and that is the difference to it.
    Otherwise the exchange is of first order: twice the change that halving the step makes
    (Richardson). In the units of the channels.

    Args:
        simulator: of a problem whose step is the rig's, or fine enough for two of them to tell the
            order.
        theta: where.
        step: at which the model values are taken.
        purpose: runs, as of `Simulator.residuals`.
    """
    problem = simulator.problem
    names = [run.name for run in problem.chosen(purpose)]
    ticks = problem.tick is not None
    if ticks and step == problem.step:
        return {name: np.zeros(problem.run(name).data.shape) for name in names}
    factor, fine = (1.0, problem.step) if ticks else (2.0, step / 2.0)
    # limits are those of another step
    coarse, exact = (
        simulator.limited({}).of(problem.changed(step=size)).residuals(theta, names, plain=True)
        for size in (step, fine)
    )
    return {
        name: factor * (b - a) * problem.sigma
        for (name, a), (_, b) in zip(coarse, exact, strict=True)
    }


def corrected(simulator: Simulator, theta: Vector, exact: Problem) -> Simulator:
    """Of a problem at its search step, with what that adds to the model taken from the data.

    It varies little with the parameters, so thousands of cheap simulations can be compared with
    the data as if they were exact (deferred correction).

    Args:
        simulator: of a problem with its system and parameters.
        theta: where the correction is taken.
        exact: holds the data and the step that count.
    """
    measured = {run.name: run.data for run in exact.runs}
    real = simulator.problem.with_data(measured).changed(step=exact.step)
    step = exact.search.step
    errors = step_error(simulator.of(real), theta, step)
    data = {run.name: run.data + errors[run.name] for run in exact.runs}
    return simulator.limited({}).of(real.with_data(data).changed(step=step))
