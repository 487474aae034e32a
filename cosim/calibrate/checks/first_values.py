"""Start values that are read off columns with noise, as if these had none."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...errors import CosimError
from .finding import Finding, quantity

if TYPE_CHECKING:
    from ..problem import Problem
    from ..simulator import Simulator

Vector = NDArray[np.float64]
SHOWS = 0.5
"""RMS over the noise, in some channel of a run, that one deviation of a start value must make: the
residual is then an eighth larger in mean square than the noise, and counts as the model's lack."""


def check_first_values(
    simulator: Simulator, theta: Vector, models: Mapping[str, Vector]
) -> Iterator[Finding]:
    """Start values of which a deviation of the noise that they were read with is felt.

    Args:
        simulator: of the problem.
        theta: parameters.
        models: what it makes of them, by run.
    """
    problem = simulator.problem
    worst: dict[str, tuple[float, float, str, str]] = {}
    for run in problem.runs:
        known = {
            name for p in (*problem.parameters, *problem.late) if p.run in ("", run.name)
            for name, _ in p.targets
        }  # fmt: skip
        for name, sigma in run.unsure.items():
            if not sigma or name in known or name not in run.starts:
                continue
            size, channel = _shown(simulator, theta, run.name, name, sigma, models[run.name])
            if size > max(SHOWS, worst.get(name, (0.0,))[0]):
                worst[name] = size, sigma, run.name, channel
    for name, (size, sigma, run_name, channel) in worst.items():
        unit = problem.system().unit(name)
        text = (
            f"{name} begins with the first value of a column whose noise ({quantity(sigma, unit)}) "
            f"moves {channel} by {size:.2g} times its own: estimate it, with a [[nuisance]] with "
            f'targets = "{name}", nominal = "first:COLUMN", a span of several of these deviations '
            "and per_run = true"
        )
        yield Finding("warning", "start", run_name, "", text)


def _shown(
    simulator: Simulator, theta: Vector, run_name: str, name: str, sigma: float, model: Vector
) -> tuple[float, str]:
    """RMS over the noise in the channel that a deviation of a start value moves most."""
    problem: Problem = simulator.problem
    run = problem.run(run_name)
    moved = replace(run, starts={**run.starts, name: run.starts[name] + sigma})
    try:
        other = simulator.simulate(theta, moved)
    except CosimError:  # what cannot be simulated there says nothing
        return 0.0, ""
    change = np.where(np.isfinite(run.data), (other - model) / problem.sigma, np.nan)
    known = np.isfinite(change).any(axis=0)
    sizes = np.zeros(known.size)
    sizes[known] = np.sqrt(np.nanmean(change[:, known] ** 2, axis=0))
    best = int(np.argmax(sizes))
    return float(sizes[best]), problem.channels[best].name
