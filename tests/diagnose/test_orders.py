"""Orders of a residual over an angle, and the shapes of laws that are tried."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from cosim.calibrate.parts import Parameter
from cosim.diagnose.choices import APART, sizes
from cosim.diagnose.orders import HIGHEST, PEAKS, peaks, spectrum
from cosim.spec.hints import SearchHints

STEP = 1e-3
TIMES = np.arange(0.0, 10.0, STEP)


def turned(fast: float) -> np.ndarray:
    """Angle of a shaft that speeds up and turns back."""
    return np.cumsum(fast * np.sin(2 * np.pi * TIMES / 8.0)) * STEP


def channels(force: np.ndarray, seed: int) -> np.ndarray:
    """Two measured signals that a force reaches through lags, noise of unit size on both."""
    slow = lfilter([0.02], [1.0, -0.98], force)
    late = np.roll(lfilter([0.3], [1.0, -0.7], force), 5)
    noise = np.random.default_rng(seed).standard_normal((TIMES.size, 2))
    return np.column_stack([slow, late]) + noise


@pytest.mark.parametrize(("order", "fast"), [(1, 60.0), (14, 60.0), (37, 15.0), (130, 15.0)])
def test_the_order_of_a_ripple_is_seen_behind_lags(order: int, fast: float) -> None:
    angle = turned(fast)
    residual = channels(2.0 * np.sin(order * angle + 0.6), 31)
    assert order in peaks(spectrum([TIMES], [angle], [residual]))


def test_two_orders_beside_a_slow_residual() -> None:
    angle = turned(40.0)
    force = np.sin(6 * angle) + 3.0 * np.sin(17 * angle + 1.0)
    residual = channels(force, 32) + 5.0 * np.sign(np.sin(2 * np.pi * TIMES / 8.0))[:, None]
    assert {6.0, 17.0} <= set(peaks(spectrum([TIMES], [angle], [residual])))


def test_noise_has_no_order() -> None:
    angle = turned(40.0)
    power = spectrum([TIMES], [angle], [channels(np.zeros(TIMES.size), 33)])
    stretches = 2 * np.ceil(np.sum(np.abs(np.diff(angle))) / (4 * np.pi))  # of two channels
    assert power.shape == (1, HIGHEST)
    # a gain has the distribution exp(-g), so ln(1 + exp(g) / M) has a mean of about (1 + ln M) / M;
    # M is 30 and more here, and the greatest of five lags is at most their sum
    assert np.mean(power) < 5.0 * stretches * (1.0 + np.log(30.0)) / 30.0
    # of 200 orders, 40 stretches and 5 lags, one gains ln 40000 by luck, less its ln M
    assert np.max(power) < np.log(HIGHEST * stretches * 5) + np.mean(power)


def test_an_order_shows_in_the_run_that_turns_slowly() -> None:
    """Beside a run with much else, in which it is too fast for the sensors."""
    slow, fast = turned(2.0), turned(200.0)
    rows = [channels(0.7 * np.sin(80 * angle), 35 + k) for k, angle in enumerate((slow, fast))]
    pulses = 40.0 * (np.random.default_rng(37).random(TIMES.size) < 0.01)
    rows[1] += channels(pulses, 38)
    assert peaks(spectrum([TIMES, TIMES], [slow, fast], rows))[0] == 80.0
    quiet = [channels(0.0 * slow, 35), channels(pulses, 38)]
    assert 80.0 not in peaks(spectrum([TIMES, TIMES], [slow, fast], quiet))


def test_gaps_and_short_runs_tell_nothing() -> None:
    angle = turned(60.0)
    residual = channels(np.sin(14 * angle), 34)
    residual[::3, 0] = np.nan
    assert peaks(spectrum([TIMES], [angle], [residual]))[0] == 14.0
    none = spectrum([TIMES[:5]], [angle[:5]], [residual[:5]])
    assert not none.any()
    assert len(peaks(none)) <= PEAKS


def parameter(start: float, low: float, high: float, decades: tuple[float, ...]) -> Parameter:
    return Parameter(
        "t", "s", start, low, high, (("t", 1.0),), "effect", span=1.0,
        hints=SearchHints(decades=decades),
    )  # fmt: skip


def test_sizes_span_the_decades_within_the_bounds() -> None:
    values = sizes(parameter(60.0, 1e-3, 1e9, (0.5, 1000.0)))
    assert values[0] == 0.5
    assert values[-1] == pytest.approx(1000.0, rel=1e-12)  # rounding of a power
    ratios = np.divide(values[1:], values[:-1])
    assert np.all(ratios < APART**1.5)
    assert sizes(parameter(60.0, 5.0, 500.0, (0.5, 1000.0)))[0] == 5.0
    assert sizes(parameter(60.0, 1e-3, 1e9, ())) == []


@pytest.mark.parametrize("decades", [(1.0,), (2.0, 1.0), (0.0, 1.0)])
def test_decades_that_are_none_are_refused(decades: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match=r"is no pair 0 < smallest < largest"):
        SearchHints(decades=decades)
