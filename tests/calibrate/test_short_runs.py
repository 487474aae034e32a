"""Windows of a log, and drives of which the end alone was measured, are runs."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosim.calibrate.checks.examine import check_data
from cosim.calibrate.checks.swaps import check_runs


@pytest.mark.parametrize("exchanged", [False, True])
def test_short_runs_that_are_alike_by_chance_have_exchanged_nothing(exchanged: bool) -> None:
    """Poses at the ends of 30 drives, to which the model's track is wrong; one sample each."""
    noise = np.random.default_rng(2).standard_normal((30, 3))
    true = np.random.default_rng(3).uniform(-1.0, 1.0, (30, 3))
    data = true + 0.015 * noise
    models = {str(k): (true[k] * [1.0, 0.7, 0.7])[None] for k in range(30)}
    if exchanged:
        far, near = np.argmax(true[:, 0]), np.argmin(true[:, 0])
        data[[far, near], 0] = data[[near, far], 0]
    runs = [SimpleNamespace(name=str(k), data=row[None]) for k, row in enumerate(data)]
    channels = [SimpleNamespace(signal=f"laser.{name}", name=name) for name in ("x", "y", "yaw")]
    problem: Any = SimpleNamespace(runs=runs, channels=channels, sigma=np.full(3, 0.015))
    found = list(check_runs(problem, models))
    assert [(f.kind, f.column) for f in found] == ([("swapped", "x")] if exchanged else [])


@pytest.mark.parametrize(("count", "size", "faults"), [(3, 40, 0), (1, 40, 1), (3, 10, 3)])
def test_windows_of_a_log_are_runs_if_most_are_as_short(noisy, count, size, faults) -> None:
    """But all together they need as many samples as a run alone."""
    problem = noisy(0)
    runs = [
        replace(run, times=run.times[:size], data=run.data[:size]) for run in problem.runs[:count]
    ]
    found = [f for f in check_data(problem.changed(runs=runs)) if f.kind == "short"]
    assert [f.run for f in found] == [run.name for run in runs][:faults]
