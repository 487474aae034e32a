"""A stated noise that is too large, and noise that is absent at a limit of short peaks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import savgol_filter

from cosim.calibrate import Problem
from cosim.calibrate.checks.averaged import averaged, check_averaged
from cosim.calibrate.checks.clipped import check_clipped
from cosim.calibrate.checks.finding import NO_SOURCE, Finding
from cosim.calibrate.checks.smooth import check_stated


def after_a_fit(
    problem: Problem, exact: Mapping[str, np.ndarray], slow: float = 0.0
) -> list[Finding]:
    """Findings where the fit ends at the truth, beside a slow error of so many stated noises."""
    index = [c.name for c in problem.channels].index("current")
    data = {run.name: run.data.copy() for run in problem.runs}
    for run in problem.runs:
        error = np.sqrt(2.0) * slow * problem.sigma[index]
        data[run.name][:, index] += error * np.sin(2.0 * np.pi * 0.5 * run.times)
    problem = problem.with_data(data)
    residuals = [
        (run.name, (run.data - exact[run.name]) / problem.sigma)
        for run in problem.chosen("identification")
    ]
    estimate: Any = SimpleNamespace(problem=problem, residuals=residuals)
    return list(check_stated(estimate))


def stated(problem: Problem, factor: float) -> Problem:
    """The current's noise is said to be so many times as large as it is."""
    channels = [
        replace(c, sigma=factor * c.sigma) if c.name == "current" else c for c in problem.channels
    ]
    return problem.changed(channels=channels, source=NO_SOURCE)


def test_a_noise_that_is_stated_too_large_is_named(noisy, exact) -> None:
    problem = noisy(0)
    true = next(c.sigma for c in problem.channels if c.name == "current")
    [found] = after_a_fit(stated(problem, 10.0), exact)
    assert (found.severity, found.kind, found.column) == ("warning", "noise", "current")
    assert "carries 0.1 of its stated noise" in found.text
    # the estimate of the noise has a deviation of a tenth in a run of 200 samples (`ENOUGH`)
    assert float(found.text.partition("sigma = ")[2]) == pytest.approx(true, rel=0.1)
    # an effect of a third of it is hidden, and the noise is named all the same
    assert [f.column for f in after_a_fit(stated(problem, 10.0), exact, 0.3)] == ["current"]


def test_a_noise_that_holds_slow_errors_too_is_no_fault(noisy, exact) -> None:
    """A pose from scans trembles by a tenth of what it is off; then a fit leaves what is stated."""
    assert after_a_fit(stated(noisy(0), 10.0), exact, 1.0) == []
    assert after_a_fit(stated(noisy(0), 1.0), exact) == []


@pytest.mark.parametrize(
    ("peaks", "limit", "named"),
    [(6, 8.0, True), (6, 99.0, False), (2, 8.0, False)],
    ids=["short stretches at a limit", "no limit", "too few to tell"],
)
def test_a_sensor_that_ends_in_short_peaks(peaks: int, limit: float, named: bool) -> None:
    """Five samples of each peak are at the limit: 30 in all, or ten and less."""
    times = np.arange(3000)
    true = sum(12.0 * np.exp(-(((times - 400 * k - 200) / 4.0) ** 2)) for k in range(peaks))
    noise = 0.02 * np.random.default_rng(4).standard_normal(times.size)
    data = np.minimum(true + noise, limit)
    assert np.sum(data == 8.0) == (0 if limit > 8.0 else 5 * peaks)
    if peaks == 2:  # one of five within the noise: 9 of 10, by chance once in 30 000
        data[np.flatnonzero(data == 8.0)[0]] -= 0.03
    run: Any = SimpleNamespace(name="A", data=data[:, None])
    channel = SimpleNamespace(name="current", unit="A", sigma=0.02)
    problem: Any = SimpleNamespace(runs=[run], channels=[channel])
    found = list(check_clipped(problem, {"A": np.asarray(true)[:, None]}))
    assert [f.text.split()[3] for f in found] == (["largest"] if named else [])


@pytest.mark.parametrize("again", [True, False])
def test_a_value_that_is_held_where_a_log_ends_is_no_limit(again: bool) -> None:
    """Of an angle that rises; it is one where the motion meets it three times."""
    times = np.arange(3000)
    true = np.abs(np.mod(times, 1000.0) if again else times) / 100.0
    noise = 0.02 * np.random.default_rng(4).standard_normal(times.size)
    data = true + noise
    top = float(np.max(data)) + 0.01
    for end in (1000, 2000, 3000) if again else (3000,):
        data[end - 12 : end] = top
    run: Any = SimpleNamespace(name="A", data=data[:, None])
    channel = SimpleNamespace(name="angle", unit="rad", sigma=0.02)
    problem: Any = SimpleNamespace(runs=[run], channels=[channel])
    found = list(check_clipped(problem, {"A": (true + 1.0)[:, None]}))
    assert len(found) == again


def mean_over(window: int, values: np.ndarray) -> np.ndarray:
    """Centred, as tools give it."""
    return np.convolve(values, np.ones(window) / window, "same")


@pytest.mark.parametrize("window", [3, 4, 11, 100])
def test_a_moving_mean_is_told_with_its_window(window: int) -> None:
    white = np.random.default_rng(window).standard_normal((2, 600))
    assert averaged([mean_over(window, row) for row in white]) == window
    # a corner that the mean has rounded is motion, and so is what a fit leaves of a slow law
    corner = mean_over(window, white[0] + np.abs(np.arange(600) - 300.0)) - np.abs(
        np.arange(600) - 300.0
    )
    slow = 3.0 * np.sin(np.arange(600) / 40.0)
    assert averaged([corner + slow]) == window


@pytest.mark.parametrize(("window", "order"), [(15, 2), (51, 3)])
def test_polynomials_through_windows_are_told_too(window: int, order: int) -> None:
    white = np.random.default_rng(window).standard_normal((2, 600))
    assert averaged([savgol_filter(row, window, order) for row in white]) == window


def test_what_is_no_moving_mean() -> None:
    """White noise, lags, held and interpolated values, a ripple, a gap, a quantised motion."""
    random = np.random.default_rng(8)
    white, times = random.standard_normal(600), np.arange(600)
    lagged = white.copy()
    for k in range(1, 600):
        lagged[k] += 0.9 * lagged[k - 1]
    gap = white.copy()
    gap[200:300] = np.nan
    few = np.arange(0, 601, 10)
    for values in (
        white, lagged, gap, np.repeat(white[:60], 10), np.interp(times, few, white[: few.size]),
        np.sin(2.0 * np.pi * times / 7.0), np.round(30.0 * np.sin(0.01 * times)), 0.0 * white,
    ):  # fmt: skip
        assert averaged([values]) == 0


def test_a_mean_is_an_error_where_the_sheet_states_the_noise_or_nothing_else_is_left(
    noisy, exact
) -> None:
    problem = noisy(0)
    index = [c.name for c in problem.channels].index("current")

    def left(source: Any, channels: Any) -> list[Finding]:
        residuals = []
        for run in problem.chosen("identification"):
            rest = (run.data - exact[run.name]) / problem.sigma
            for k in channels:
                rest[:, k] = mean_over(9, rest[:, k])
            residuals.append((run.name, rest))
        estimate: Any = SimpleNamespace(problem=problem.changed(source=source), residuals=residuals)
        return list(check_averaged(estimate))

    everything = range(len(problem.channels))
    [found] = left(NO_SOURCE, [index])
    assert (found.severity, found.kind, found.column) == ("warning", "smoothed", "current")
    assert "is smoothed over windows of 9 samples" in found.text
    [found] = left(replace(NO_SOURCE, instruments=frozenset(["current"])), [index])
    assert found.severity == "error"
    assert {f.severity for f in left(NO_SOURCE, everything)} == {"error"}
    assert left(NO_SOURCE, []) == []
    assert left(replace(NO_SOURCE, made=frozenset(["current"])), [index]) == []
