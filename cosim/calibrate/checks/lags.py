"""Columns that fit better when they are shifted in time: of one run, or one of all runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..clocks import clocked
from .finding import Finding

if TYPE_CHECKING:
    from ..problem import Problem

Vector = NDArray[np.float64]
ENOUGH = 0.1
"""Share of samples that must be measured to judge a lag."""


def check_lags(problem: Problem, models: Mapping[str, Vector], evident: float) -> Iterator[Finding]:
    """A run, or one column in all runs, that fits much better when it is shifted in time."""
    lags: dict[tuple[str, int], tuple[int, float]] = {}
    estimated = clocked(problem.parameters)
    for run in problem.runs:
        reach = min(run.times.size // 8, 200)
        for index in range(len(problem.channels)):
            lags[run.name, index] = _best_lag(
                run.data[:, index], models[run.name][:, index], reach,
                problem.channels[index].sigma,
            )  # fmt: skip
    for run in problem.runs:
        own = [lags[run.name, i] for i in range(len(problem.channels))]
        sure = [lag for lag, gain in own if gain > evident]
        interval = run.interval
        if (
            len(sure) > len(own) / 2
            and not estimated
            and abs(np.median(sure)) >= 2
            and np.ptp(sure) <= 2 + 0.2 * abs(np.median(sure))
        ):
            late = float(np.median(sure)) * interval
            text = f"all columns fit better shifted: they are late by {late:.4g} s (clock offset)"
            yield Finding("warning", "clock", run.name, "time", text)
    for index, channel in enumerate(problem.channels):
        if channel.name in estimated:
            continue
        sure = [
            lags[run.name, index][0] for run in problem.runs if lags[run.name, index][1] > evident
        ]
        others = [lags[run.name, i][0] for run in problem.runs for i in range(len(problem.channels))
                  if i != index and lags[run.name, i][1] > evident]  # fmt: skip
        apart = not others or abs(np.median(others) - np.median(sure or [0])) >= 2
        if len(sure) > len(problem.runs) / 2 and abs(np.median(sure)) >= 2 and apart:
            interval = problem.runs[0].interval
            text = f"is late by {np.median(sure) * interval:.4g} s against the model (clock offset)"
            yield Finding("warning", "clock", "", channel.name, text)


def _best_lag(measured: Vector, simulated: Vector, reach: int, sigma: float) -> tuple[int, float]:
    """Lag in samples with the least squares, and by what factor it is better than none."""

    def misfit(lag: int) -> float:
        late = measured[reach + lag : measured.size - reach + lag]
        apart = late - simulated[reach : measured.size - reach]
        good = np.isfinite(apart)
        # a lag at which next to nothing is measured says nothing
        return float(np.mean(apart[good] ** 2)) if np.mean(good) > ENOUGH else np.inf

    if reach < 2 or not np.isfinite(measured).any() or np.std(simulated) < 5.0 * sigma:
        return 0, 1.0
    if not np.isfinite(misfit(0)):
        return 0, 1.0
    coarse = min(range(-reach, reach + 1, max(reach // 40, 1)), key=misfit)
    near = range(max(coarse - reach // 40, -reach), min(coarse + reach // 40, reach) + 1)
    best = min(near, key=misfit)
    return best, misfit(0) / (misfit(best) + sigma**2)
