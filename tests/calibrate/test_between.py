"""Inputs that are means over the intervals between samples, and what they were within."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from cosim.calibrate.between import between

Vector = NDArray[np.float64]
INTERVAL = 0.02


def swung(count: int, interval: float = INTERVAL) -> tuple[Vector, Vector]:
    """Times, and means over the intervals that end there of a speed that swings once a second."""
    times: Vector = np.asarray(interval * np.arange(float(count)))
    passed = 1.0 - np.cos(2.0 * np.pi * times)
    return times, np.diff(passed, prepend=passed[0]) / interval


def test_what_is_passed_in_each_interval_stays() -> None:
    times, means = swung(200)
    fine, values, parts = between(times, means, INTERVAL / 4.0)
    assert parts == 4
    assert fine.size == 4 * 199 + 1
    passed = np.add.reduceat(values[:-1] * np.diff(fine), np.arange(0, fine.size - 1, 4))
    assert passed == pytest.approx(means[1:] * INTERVAL, abs=1e-12)  # rounding


def test_it_is_the_motion_within_the_intervals() -> None:
    """Of fourth order: halved intervals leave a sixteenth; held means leave a half."""
    left = {}
    for interval in (0.04, 0.02):
        times, means = swung(round(4.0 / interval), interval)
        fine, values, _ = between(times, means, interval / 4.0)
        true = -np.diff(np.cos(2.0 * np.pi * fine)) / np.diff(fine)
        inner = slice(40, -40)  # at both ends nothing is known of the acceleration
        left[interval] = np.max(np.abs(values[:-1] - true)[inner])
        held = np.max(np.abs(np.repeat(means[1:], 4) - true)[inner])
        assert left[interval] < 0.02 * held
    # the speed loses one order of the angle's four
    assert left[0.02] < left[0.04] / 6.0


def test_a_step_as_long_as_the_interval_takes_the_means_as_they_are() -> None:
    times, means = swung(50)
    fine, values, parts = between(times, means, INTERVAL)
    assert parts == 1
    assert fine.tolist() == times.tolist()
    assert values.tolist() == [*means[1:].tolist(), means[-1]]


def test_beside_a_lost_sample_means_are_held() -> None:
    times, means = swung(100)
    kept = np.delete(np.arange(100), 50)
    fine, values, _ = between(times[kept], means[kept], INTERVAL / 4.0)
    there = (fine > times[49] + 1e-9) & (fine < times[51] - 1e-9)
    assert np.count_nonzero(there) == 7
    assert set(values[there].tolist()) == {means[51]}


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_few_samples_are_held(count: int) -> None:
    times, means = swung(count)
    _, values, _ = between(times, means, INTERVAL / 4.0)
    assert set(values.tolist()) == {*means[1:].tolist(), means[-1]}
