"""Which run would separate two explanations best."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..calibrate.differences import jacobian
from ..calibrate.known import STEP
from ..calibrate.parts import MeasuredRun
from ..calibrate.simulator import Simulator
from ..data.signals import Table
from ..errors import CosimError
from .linear import SampleStack
from .models import Fitted
from .secant import model_values

Vector = NDArray[np.float64]
FACTORS = (1.0, -1.0, 0.3, 1.5)
"""The library: every run of the data set again, reversed, gentler and stronger."""
ENOUGH = 4.0
"""Distance in standard deviations at which two explanations are told apart reliably (2 for the
decision plus 2 for its power)."""
REPEATED, TRIED = 20, 4
"""Times at most that a run is to be repeated (explanations then differ by 0.9 deviations in each,
which is about what one shows), and runs whose distance is asked for, each for a fit's derivatives:
calibration takes back most of the largest difference if one is an offset of the other."""


def scaled(run: MeasuredRun, factor: float) -> MeasuredRun | None:
    """A run with its inputs scaled; None if they cannot be."""
    inputs = {}
    for name, signal in run.inputs.items():
        if not isinstance(signal, Table):
            return None
        inputs[name] = signal.scaled(factor)
    return replace(run, inputs=inputs)


def propose(first: Fitted, second: Fitted) -> dict[str, Any] | None:
    """The run of the library in which two fitted models differ most, and by how much per channel.

    It is the first of those in which they differ most, as they are, that tells them apart if it is
    repeated `REPEATED` times or less. The distance leaves out what calibration of the first model
    could take back in that run without doing worse in the runs at hand.

    Args:
        first, second: models fitted to the same runs.

    Returns:
        run, input_factor, distance [standard deviations], repetitions, and channels: what the
        models differ by in each, as they are; None if no run would do.
    """
    found: list[tuple[float, MeasuredRun, float, SampleStack, Vector]] = []
    for run in first.problem.runs:
        for factor in FACTORS:
            changed = scaled(run, factor) if factor != 1.0 else run
            if changed is None:
                continue
            try:
                stack, change = _difference(first, second, changed)
            except (CosimError, ValueError):  # not a run for these models
                continue
            found.append((float(np.linalg.norm(change)), changed, factor, stack, change))
    for _, run, factor, stack, change in sorted(found, key=lambda item: -item[0])[:TRIED]:
        try:
            distance = _left(first, run, stack, change)
        except CosimError:  # one that few parameter values can go through
            continue
        needed = (ENOUGH / max(distance, 1e-9)) ** 2
        if needed > REPEATED:
            continue
        squares = np.bincount(stack.channel, change**2, stack.channels)
        names = [c.name for c in first.problem.channels]
        return {
            "run": run.name,
            "input_factor": factor,
            "distance": distance,
            "repetitions": max(math.ceil(needed), 1),
            "channels": dict(zip(names, np.sqrt(squares).tolist(), strict=True)),
        }
    return None


def _of(fitted: Fitted, run: MeasuredRun) -> Simulator:
    """A simulator of a fitted model in this run, which may take longer than those at hand."""
    return fitted.simulator.limited({}).of(fitted.problem.changed(runs=[run]))


def _difference(first: Fitted, second: Fitted, run: MeasuredRun) -> tuple[SampleStack, Vector]:
    """Model values of the second less those of the first, over sigma."""
    values = []
    for item in (first, second):
        simulator = _of(item, run)
        stack = SampleStack(simulator.problem, [run])
        values.append(model_values(simulator, item.estimate.theta, stack))
        simulator.close()
    return stack, values[1] - values[0]


def _left(fitted: Fitted, run: MeasuredRun, stack: SampleStack, change: Vector) -> float:
    """Norm of what is left of a change of a run when the parameters follow it.

    min  |change - J d|^2 + d^T H d    over d,   H: information of the runs at hand
    """
    simulator = _of(fitted, run)
    problem = simulator.problem
    found = jacobian(simulator, fitted.estimate.theta, [run.name], central=False, relative=STEP)
    simulator.close()
    slopes = stack.matrix(found, problem.scale)
    known = np.zeros((slopes.shape[1], slopes.shape[1]))
    for item, (_, residual) in zip(
        fitted.estimate.jacobian, fitted.estimate.residuals, strict=True
    ):
        # what a late clock moves out of a run tells nothing of any parameter
        part = np.nan_to_num(item.values * problem.scale[item.columns])[np.isfinite(residual)]
        known[np.ix_(item.columns, item.columns)] += part.T @ part
    for i, p in enumerate(problem.parameters):
        if p.run:  # the next run starts elsewhere
            known[i], known[:, i] = 0.0, 0.0
        if p.prior:
            known[i, i] += (p.scale / p.prior) ** 2
    along = slopes.T @ change
    taken = np.linalg.lstsq(slopes.T @ slopes + known, along, rcond=1e-12)[0]
    return math.sqrt(max(float(change @ change) - float(along @ taken), 0.0))
