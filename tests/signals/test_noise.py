"""Random numbers of the sensors: exact arithmetic, statistics, reproducibility."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest
from scipy import stats

from sources.laws.noise import RANDOM, Random
from tests.support import Stepper

COUNT = 20_000
FOUR_SIGMA = 4.0  # chance of a false alarm 6e-5 per figure; the numbers are always the same ones


def draw(seed: int, count: int = COUNT) -> tuple[np.ndarray, np.ndarray]:
    """(uniform, four normals) numbers as a component draws them, and the states in between."""
    state = ca.SX.sym("state", 2)
    random = Random(state, ca.SX(float(seed)))
    numbers = ca.vertcat(random.uniform(), random.normals(4))
    step = ca.Function("step", [state], [random.state, numbers])
    chain = step.mapaccum(count)
    states, drawn = chain(np.array(RANDOM.starts()))
    return np.asarray(drawn).T, np.asarray(states).T


NUMBERS, STATES = draw(7)


def test_generators_are_exact_in_doubles() -> None:
    """The same recursion in unlimited integers."""
    (a1, m1), (a2, m2) = (40014, 2147483563), (40692, 2147483399)
    a, b = 1 + 7 * a1 % (m1 - 1), 1 + 7 * a2 % (m2 - 1)
    for _ in range(4):
        a, b = a * a1 % m1, b * a2 % m2
    for k in range(2000):
        for draw_index in range(5):
            a, b = a * a1 % m1, b * a2 % m2
            if draw_index == 0:
                uniform = ((a - b - 1) % (m1 - 1) + 1) / m1
        assert (a, b) == tuple(STATES[k])
        assert NUMBERS[k, 0] == uniform


def test_largest_product_stays_below_the_exact_integers() -> None:
    assert 40692 * 2147483399 < 2**53 and 40014 * 2147483398 < 2**53


def test_normal_numbers_are_standard_normal() -> None:
    normals = NUMBERS[:, 1:].ravel()
    n = normals.size
    assert abs(normals.mean()) < FOUR_SIGMA / math.sqrt(n)
    assert abs(normals.std() - 1) < FOUR_SIGMA / math.sqrt(2 * n)
    # Probability of a distance this large if the numbers are normal: not below 0.1 %.
    assert stats.kstest(normals, "norm").pvalue > 1e-3
    assert stats.kstest(NUMBERS[:, 0], "uniform").pvalue > 1e-3


def test_numbers_are_white_and_channels_independent() -> None:
    limit = FOUR_SIGMA / math.sqrt(COUNT)
    standard = (NUMBERS - NUMBERS.mean(axis=0)) / NUMBERS.std(axis=0)
    for lag in (1, 2, 3, 5, 10):
        correlation = standard[:-lag].T @ standard[lag:] / (COUNT - lag)
        assert np.abs(correlation).max() < 1.2 * limit  # the largest of 25 figures
    together = standard.T @ standard / COUNT - np.eye(5)
    assert np.abs(together).max() < limit


def test_neighbouring_seeds_give_unrelated_numbers() -> None:
    normals = np.array([draw(seed, 5000)[0][:, 1] for seed in (1, 2, 3, 1000)])
    correlation = np.corrcoef(normals) - np.eye(4)
    assert np.abs(correlation).max() < FOUR_SIGMA / math.sqrt(5000)
    assert np.ptp(normals[:, 0]) > 0.1  # and they do not start alike


def test_sensor_repeats_its_noise_and_another_seed_changes_it() -> None:
    runs = []
    for seed in (11.0, 11.0, 12.0):
        stepper = Stepper("pose_sensor/motion_capture", {"seed": seed})
        runs.append([stepper.step({}, 0.01)["x_meas"] for _ in range(50)])
    assert runs[0] == runs[1]
    assert not set(runs[0]) & set(runs[2])


def test_noise_effect_has_its_standard_deviation_and_holds_in_between() -> None:
    values = {"noise.sigma": 0.15, "noise.t_s": 0.002}
    stepper = Stepper("encoder/ideal+noise", values)
    read = np.array([stepper.step({"w": 4.0}, 0.001)["w_meas"] for _ in range(4000)]) - 4.0
    assert np.array_equal(read[0::2], read[1::2])
    fresh = read[::2]
    assert abs(fresh.std() - 0.15) < FOUR_SIGMA * 0.15 / math.sqrt(2 * fresh.size)
    assert abs(np.mean(fresh[1:] * fresh[:-1])) < FOUR_SIGMA * 0.15**2 / math.sqrt(fresh.size)


def test_elements_of_a_vector_get_different_noise() -> None:
    stepper = Stepper("inverse_kinematics/body+noise@command")
    out = stepper.step({"v_d": 0.1}, 0.01)
    assert out["w_l_ref"] != pytest.approx(out["w_r_ref"], abs=1e-4)  # sigma is 0.01
