"""Calibration that does not depend on the communication step.

What values exchanged at communication points only add to a model is systematic: over thousands of
samples, half the noise moves parameters by many of their standard deviations. So it is measured by
runs with finer steps, and taken from the data of a second fit (deferred correction):

    m_k = model at step h / 2^k,   e_k = 2 m_k - m_(k-1)   (Richardson, of first order)

until `e_k` no longer changes by more than `TENTH` of what a fit leaves, nor parameters by as much
of their deviations. A method of second order gets a smaller correction than it could, and a larger
estimate of what is left. Where the correction still changes with the parameters after `ROUNDS` fits
the step of the fit itself is halved.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ..errors import CosimError
from .estimate import Estimate
from .fit import Effort, fit
from .loss import loss_for
from .normal import KNOWN, Normal, gradient
from .simulator import Simulator

Vector = NDArray[np.float64]
TENTH = 0.1
"""Share of the noise (of what the fit leaves, where that is more), and of the deviation of each
parameter, below which an error of the step is none."""
HALVINGS = 5
"""Times the step is halved at most to measure its error: 63 times the work of one simulation."""
HALF = 0.5
"""Share of what is allowed that each of two errors may take: what is unsure of the correction, and
what the last fit changed of it."""
ROUNDS, SLOW = 8, 0.7
"""Fits with a correction at one step at most, each with that of where the last one ended; and the
share of what one fit changed that the next may change at most."""
COARSER = 2
"""Halvings of the step of the fit at most."""
CLOSE = Effort("near")
"""Of fits with a correction: they begin where the last one ended."""


@dataclass(frozen=True)
class StepError:
    """What the communication step adds to the model, and what was done about it.

    Attributes:
        step: that was asked for [s].
        finest: with which its error was measured [s]; 0 if it could not be.
        channels: by channel, root mean square of the error of the first fit's step over the noise,
            in the identification runs.
        left: the same of what the correction still leaves.
        moved: by parameter, how far the error would move it, over its standard deviation.
        unsure: the same of what is left; the intervals contain it.
        corrected: step of the fit from whose data it was taken off [s]; 0 if it was not.
        evaluations: simulated runs of measuring it and of further fits.
        text: why nothing was measured.
    """

    step: float
    finest: float = 0.0
    channels: Mapping[str, float] = field(default_factory=dict)
    left: Mapping[str, float] = field(default_factory=dict)
    moved: Mapping[str, float] = field(default_factory=dict)
    unsure: Mapping[str, float] = field(default_factory=dict)
    corrected: float = 0.0
    evaluations: int = 0
    text: str = ""

    @property
    def small(self) -> bool:
        """Whether what is left is below `TENTH`."""
        values = [*self.left.values(), *self.unsure.values()]
        return self.finest > 0.0 and all(value < TENTH for value in values)

    def __str__(self) -> str:
        """One line for people."""
        if self.text:
            return self.text
        name, size = _largest(self.channels)
        line = f"a communication step of {self.step:g} s adds {size:.2g} of the noise to {name}"
        if not self.corrected:
            return f"{line}: too little to move a parameter"
        parameter, far = _largest(self.moved)
        rest, unsure = _largest(self.left)[1], _largest(self.unsure)[1]
        line += (
            f" and moves {parameter} by {far:.2g} deviations; taken off by steps down to "
            f"{self.finest:g} s, which leaves {rest:.2g} of the noise and {unsure:.2g} deviations"
            + (f" of a fit at {self.corrected:g} s" if self.corrected != self.step else "")
        )
        if not self.small:
            line += "; intervals are wider by these. Take a smaller step or another algorithm"
        return line

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "step": self.step, "finest": self.finest, "corrected": self.corrected,
            "channels": dict(self.channels), "left": dict(self.left), "moved": dict(self.moved),
            "unsure": dict(self.unsure), "text": str(self),
        }  # fmt: skip


def _largest(values: Mapping[str, float]) -> tuple[str, float]:
    return max(values.items(), key=lambda item: item[1])


Errors = dict[str, Vector]
"""Of the model values over the noise, by run."""


class _Measure:
    """How much errors of the model count beside what a fit knows."""

    def __init__(self, estimate: Estimate) -> None:
        problem = estimate.problem
        self.estimate, self.problem = estimate, problem
        self.loss = loss_for(problem.unstable, estimate.residuals)
        normal = Normal(
            problem, estimate.theta, estimate.jacobian, estimate.residuals, self.loss
        )  # fmt: skip
        values, vectors = np.linalg.eigh(normal.matrix)
        good = values > 1.0 / KNOWN**2
        self.inverse = (vectors[:, good] / values[good]) @ vectors[:, good].T
        stacked = np.concatenate([r for _, r in estimate.residuals])
        with np.errstate(invalid="ignore"):
            self.scale = np.maximum(_rms(stacked), 1.0)

    def channels(self, errors: Errors) -> Vector:
        """Root mean square over the noise by channel, where something was measured."""
        return _rms(
            np.concatenate(
                [
                    np.where(np.isfinite(residual), errors[name], np.nan)
                    for name, residual in self.estimate.residuals
                ]
            )
        )

    def moves(self, errors: Errors) -> Vector:
        """By how much errors of the model move the parameters, over their deviations."""
        rows = [  # white, as the derivatives are
            (name, self.problem.run(name).white(
                np.where(np.isfinite(residual), errors[name], np.nan)))
            for name, residual in self.estimate.residuals
        ]  # fmt: skip
        steep = gradient(self.problem, self.problem.nominal, self.estimate.jacobian, rows)
        deviation = np.maximum(self.estimate.deviation, 1e-300)
        return np.asarray(np.abs(self.inverse @ steep) * self.problem.scale / deviation)

    def small(self, errors: Errors, share: float = 1.0) -> bool:
        """Whether errors are below a share of `TENTH` of noise and deviations."""
        return self.largest(errors) < share * TENTH

    def largest(self, errors: Errors) -> float:
        """The largest share of noise or deviations that errors make."""
        sizes = [*(self.channels(errors) / self.scale), *self.moves(errors)]
        return float(np.max(np.nan_to_num(np.array(sizes))))

    def by_channel(self, errors: Errors) -> dict[str, float]:
        names = [c.name for c in self.problem.channels]
        return dict(zip(names, np.nan_to_num(self.channels(errors)).tolist(), strict=True))

    def by_parameter(self, errors: Errors) -> dict[str, float]:
        return dict(zip(self.problem.names, self.moves(errors).tolist(), strict=True))


def _rms(rows: Vector) -> Vector:
    known = np.isfinite(rows)
    return np.asarray(
        np.sqrt(np.sum(np.where(known, rows, 0.0) ** 2, axis=0) / np.maximum(known.sum(axis=0), 1))
    )


def calibrated(simulator: Simulator, theta: Vector | None = None) -> tuple[Estimate, StepError]:
    """Estimate the parameters of a problem, free of what its communication step adds.

    Where the rig has ticks, the step is fine enough for them and there is nothing to take off.

    Args:
        simulator: of the problem.
        theta: where to begin, the nominal values if not given.
    """
    problem = simulator.problem
    # sums over more threads are rounded in another way, and jumps make much of that
    with threadpool_limits(1, user_api="blas"):
        estimate = fit(simulator, theta)
        if problem.tick is not None:
            text = f"{problem.step:g} s is taken as exact for the rig's ticks of {problem.tick:g} s"
            return estimate, StepError(problem.step, problem.step, text=text)
        try:
            return _corrected(simulator, estimate)
        except CosimError as error:  # an FMU that takes this step need not take others
            text = f"the error of the communication step could not be measured: {error}"
            return estimate, StepError(problem.step, text=text)


def _corrected(simulator: Simulator, first: Estimate) -> tuple[Estimate, StepError]:
    problem, estimate = simulator.problem, first
    measured = {run.name: run.data for run in problem.runs}
    step, finer = problem.step, _Finer(simulator)
    errors, left = finer.settled(_Measure(first), step)
    initial = _Measure(first)
    report = StepError(
        step, finer.step, initial.by_channel(errors), initial.by_channel(left),
        initial.by_parameter(errors), initial.by_parameter(left),
    )  # fmt: skip
    if initial.small(errors):
        return first, replace(
            report, left=report.channels, unsure=report.moved, evaluations=finer.evaluations
        )
    evaluations = 0
    for halved in range(COARSER + 1):
        step = problem.step / 2**halved
        if halved:
            errors = finer.errors(estimate.theta, step)
        least = np.inf
        for _ in range(ROUNDS):
            data = {n: values + errors[n] * problem.sigma for n, values in measured.items()}
            part = simulator.of(problem.with_data(data).changed(step=step))
            estimate = fit(part, estimate.theta, effort=CLOSE)
            evaluations += estimate.evaluations
            before = errors
            errors = finer.errors(estimate.theta, step)
            change = {name: errors[name] - before[name] for name in errors}
            measure = _Measure(estimate)
            settled = measure.small(change, HALF)
            size = measure.largest(change)
            if settled or size > SLOW * least:
                break
            least = size
        if settled:
            break
    whole = {name: np.abs(left[name]) + np.abs(change[name]) for name in left}
    unsure = {
        name: a + b
        for (name, a), b in zip(
            measure.by_parameter(left).items(), measure.moves(change).tolist(), strict=True
        )
    }
    report = replace(
        report, left=measure.by_channel(whole), unsure=unsure, corrected=step,
        evaluations=evaluations + finer.evaluations,
    )  # fmt: skip
    return _widened(estimate, unsure), report


def _widened(estimate: Estimate, unsure: Mapping[str, float]) -> Estimate:
    """With intervals that contain what the step's error may still move parameters by."""
    extra = np.array([unsure[name] for name in estimate.problem.names]) * estimate.deviation
    problem = estimate.problem
    return replace(
        estimate,
        low=np.maximum(estimate.low - extra, problem.lower),
        high=np.minimum(estimate.high + extra, problem.upper),
    )


class _Finer:
    """The model with finer steps."""

    def __init__(self, simulator: Simulator) -> None:
        self.simulator = simulator.limited({})
        self.step = simulator.problem.step
        self.evaluations = 0

    def _model(self, theta: Vector, step: float) -> Errors:
        """Minus the model values over the noise, up to the data, by run."""
        simulator = self.simulator.of(self.simulator.problem.changed(step=step))
        try:
            return dict(simulator.residuals(theta, None, plain=True))
        finally:
            self.evaluations += simulator.evaluations
            simulator.close()

    def settled(self, measure: _Measure, step: float) -> tuple[Errors, Errors]:
        """Errors of a step and what is unsure of them; finds how fine steps must be for that."""
        theta = measure.estimate.theta
        models = [self._model(theta, step)]
        exact: list[Errors] = []
        left: Errors = {}
        for halving in range(1, HALVINGS + 1):
            self.step = step / 2**halving
            models.append(self._model(theta, self.step))
            exact.append({n: 2.0 * models[-1][n] - models[-2][n] for n in models[0]})
            left = {n: models[-1][n] - models[-2][n] for n in models[0]}
            if halving == 1 and not measure.small({n: 2.0 * v for n, v in left.items()}):
                continue
            if halving > 1:
                left = {n: exact[-1][n] - exact[-2][n] for n in models[0]}
            if measure.small(left, HALF):
                break
        # residuals have the model with a minus
        return {n: _error(models[0][n], exact[-1][n]) for n in models[0]}, _plain(left)

    def errors(self, theta: Vector, step: float) -> Errors:
        """The same elsewhere, with the steps that were found."""
        coarse = self._model(theta, step)
        fine, finer = (self._model(theta, size) for size in (2.0 * self.step, self.step))
        exact = {n: 2.0 * finer[n] - fine[n] for n in coarse}
        return {n: _error(coarse[n], exact[n]) for n in coarse}


def _error(coarse: Vector, exact: Vector) -> Vector:
    """Of the model; gaps have none."""
    return np.asarray(np.nan_to_num(exact - coarse))


def _plain(errors: Errors) -> Errors:
    return {name: np.asarray(np.nan_to_num(values)) for name, values in errors.items()}
