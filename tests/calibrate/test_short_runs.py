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
    """Poses at the ends of 30 drives, to which the model's track is wrong; four samples each."""
    noise = np.random.default_rng(2).standard_normal((30, 4, 3))
    true = np.random.default_rng(3).uniform(-1.0, 1.0, (30, 1, 3))
    data = true + 0.015 * noise
    models = {str(k): true[k] * [1.0, 0.7, 0.7] + np.zeros((4, 3)) for k in range(30)}
    if exchanged:
        far, near = np.argmax(true[:, 0, 0]), np.argmin(true[:, 0, 0])
        data[[far, near], :, 0] = data[[near, far], :, 0]
    found = list(check_runs(drives(data), models))
    assert [(f.kind, f.column) for f in found] == ([("swapped", "x")] if exchanged else [])


def test_of_many_pairs_some_fit_each_other_by_chance() -> None:
    """Single poses, a third of them three deviations off, as by a heading lost at the start."""
    for seed in range(100):
        random = np.random.default_rng(seed)
        true = random.uniform(-0.1, 0.1, (30, 1, 3))
        size = 0.015 * np.where(np.arange(30) % 3, 0.5, 3.0)
        data = true + size[:, None, None] * random.standard_normal((30, 1, 3))
        models = {str(k): rows for k, rows in enumerate(true)}
        assert not list(check_runs(drives(data), models)), seed


def drives(data: np.ndarray) -> Any:
    """What the check looks at of a problem with these samples, by run."""
    runs = [SimpleNamespace(name=str(k), data=rows) for k, rows in enumerate(data)]
    channels = [SimpleNamespace(signal=f"laser.{name}", name=name) for name in ("x", "y", "yaw")]
    return SimpleNamespace(runs=runs, channels=channels, sigma=np.full(3, 0.015))


@pytest.mark.parametrize(("count", "size", "faults"), [(3, 40, 0), (1, 40, 1), (3, 10, 3)])
def test_windows_of_a_log_are_runs_if_most_are_as_short(noisy, count, size, faults) -> None:
    """But all together they need as many samples as a run alone."""
    problem = noisy(0)
    runs = [
        replace(run, times=run.times[:size], data=run.data[:size]) for run in problem.runs[:count]
    ]
    found = [f for f in check_data(problem.changed(runs=runs)) if f.kind == "short"]
    assert [f.run for f in found] == [run.name for run in runs][:faults]
