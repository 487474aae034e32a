"""Speeds from whole counts: the smoothest motion that has them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from cosim.calibrate.counts import smoothest, steady, whole_counts

Vector = NDArray[np.float64]
INTERVAL, COUNT = 0.02, 2.0 * np.pi / 25600


def counted(speed: Vector, phase: float = 0.3) -> Vector:
    """Whole counts within each interval, of a speed [rad/s] at its end."""
    angle = np.floor(np.cumsum(speed) * INTERVAL / COUNT + phase)
    return np.diff(angle, prepend=np.floor(phase))


def ramped(speed: float) -> tuple[Vector, Vector]:
    """Times, and a speed that rises smoothly from rest within 0.6 s, and falls again."""
    times = INTERVAL * np.arange(400.0)
    x = np.clip(np.minimum(times - 0.5, 7.3 - times) / 0.6, 0.0, 1.0)
    return np.asarray(times), np.asarray(speed * x * x * (3.0 - 2.0 * x))


@pytest.mark.parametrize("speed", [0.5, 2.0, -3.2, 4.8])
def test_a_smooth_speed_comes_back_from_its_counts(speed: float) -> None:
    times, true = ramped(speed)
    counts = counted(true)
    rounded = counts * COUNT / INTERVAL - true
    smooth = steady(counts, times) * COUNT / INTERVAL - true
    # what stays is slow: where within its count the angle was on the way from rest
    assert np.std(smooth) < np.std(rounded) / 2.0


@pytest.mark.parametrize("jump", [3.0, 60.0])
def test_no_angle_leaves_its_count_even_where_the_speed_jumps(jump: float) -> None:
    per_interval = np.where(np.arange(200) < 90, 40.3, 40.3 + jump)
    counts = np.floor(np.cumsum(per_interval))
    assert np.max(np.abs(smoothest(counts) - counts)) < 0.5


def test_at_rest_and_at_whole_counts_nothing_changes() -> None:
    times: Vector = np.asarray(INTERVAL * np.arange(100.0))
    for count in (0.0, 7.0):
        assert steady(np.full(100, count), times) == pytest.approx(np.full(100, count), abs=1e-6)


def test_it_begins_anew_after_a_lost_sample() -> None:
    """Counts within two intervals are no speed of one; what was lost moves nothing else."""
    times, true = ramped(2.0)
    counts = counted(true)
    kept = np.delete(np.arange(times.size), 200)
    found = steady(counts[kept], times[kept])
    assert found[200] == counts[201]
    alone = steady(counts[:200], times[:200])
    assert found[:200] == pytest.approx(alone, abs=1e-9)


def test_a_few_samples_are_what_they_are() -> None:
    assert smoothest(np.array([0.0, 2.0, 5.0])).tolist() == [0.0, 2.0, 5.0]


@pytest.mark.parametrize("above", [True, False])
@pytest.mark.parametrize("beyond", [0.42, 0.48, 0.52, 0.58])
def test_a_count_whose_noise_passes_the_middle_is_told_by_the_motion(
    beyond: float, above: bool
) -> None:
    counts = counted(ramped(4.8)[1])
    noisy = counts + 0.02 * np.random.default_rng(1).standard_normal(counts.size)
    noisy[200] = counts[200] + (beyond if above else -beyond)
    assert (np.rint(noisy)[200] == counts[200]) == (beyond < 0.5)
    assert whole_counts(noisy).tolist() == counts.tolist()


def test_where_the_motion_does_not_tell_a_count_is_the_nearest() -> None:
    random = np.random.default_rng(2)
    counts = np.asarray(random.integers(-50, 50, 200), dtype=np.float64)  # shaken
    noisy = counts + np.where(np.arange(200) % 20 == 10, 0.55, 0.0)
    assert whole_counts(noisy).tolist() == np.rint(noisy).tolist()


def test_counts_of_a_noisy_log_come_back() -> None:
    """But for those during a ramp, of which nothing is known, and for some that are near others."""
    times, true = ramped(3.3)
    wrong = rounded = 0
    for seed in range(40):
        counts = counted(true, seed / 40.0)
        noisy = counts + 0.18 * np.random.default_rng(seed).standard_normal(counts.size)
        level = (times > 1.5) & (times < 6.3)
        rounded += int(np.sum((np.rint(noisy) != counts)[level]))
        wrong += int(np.sum((whole_counts(noisy) != counts)[level]))
    assert rounded > 30 and wrong < rounded / 4  # noise of 0.18: every 190th is wrong
