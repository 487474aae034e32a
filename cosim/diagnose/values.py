"""What a fitted model gives, with the rig's own exchange where that is asked for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..calibrate.deferred import step_error
from ..calibrate.problem import Problem
from ..calibrate.simulator import Simulator
from .linear import SampleStack

Vector = NDArray[np.float64]


class Values:
    """Model values over sigma in identification and validation runs.

    The rig's exchange may take fifty times as long as that of a search, so identification runs are
    simulated with it when they are first asked for.

    Args:
        fit: values in identification runs, or what simulates them.
        check: values in validation runs.
        near: what simulates `fit` with the search's exchange, corrected for where the fit began.
    """

    def __init__(
        self,
        fit: Vector | Callable[[], Vector],
        check: Vector,
        near: Callable[[], Vector] | None = None,
    ) -> None:
        self._fit, self.check, self._near = fit, check, near

    @property
    def fit(self) -> Vector:
        """In identification runs."""
        if callable(self._fit):
            self._fit = self._fit()
        return self._fit

    def nearly(self) -> Values:
        """Those of the search's exchange in identification runs, unless others are known."""
        if self._near is None or not callable(self._fit):
            return self
        return Values(self._near(), self.check)


def exact(simulator: Simulator, theta: Vector, raw: Problem, stack: SampleStack) -> Vector:
    """Model values over sigma, free of what the search's step adds.

    Args:
        simulator: of the model, without regard to its data and step.
        theta: its parameters.
        raw: the data as measured, and the rig's step.
        stack: of the runs.
    """
    data = {run.name: run.data for run in raw.runs}
    problem = simulator.problem.with_data(data).changed(step=raw.step)
    real = simulator.limited({}).of(problem)
    errors = step_error(real, theta, raw.step, stack.names)
    return stack.vector(
        [
            data[name] / problem.sigma
            - problem.run(name).white(errors[name] / problem.sigma)
            - residual
            for name, residual in real.residuals(theta, stack.names)
        ]
    )


def near(simulator: Simulator, theta: Vector, raw: Problem, stack: SampleStack) -> Vector:
    """The same with the search's exchange, its error taken from where the model's data have it."""
    sigma = simulator.problem.sigma
    return stack.vector(
        [
            raw.run(name).data / sigma - residual
            for name, residual in simulator.residuals(theta, stack.names)
        ]
    )
