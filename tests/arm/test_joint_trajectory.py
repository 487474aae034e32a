"""Paths of joints: ends, derivatives, spectra."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from sources.function import Oracle
from tests.arm.chains import named, vector
from tests.support import oracle_of


@lru_cache(maxsize=None)
def oracle(fidelity: str) -> Oracle:
    return oracle_of(f"joint_trajectory/{fidelity}")


@pytest.mark.parametrize("fidelity", ["quintic", "swing", "multisine"])
def test_speeds_and_accelerations_are_derivatives(fidelity: str) -> None:
    model, h = oracle(fidelity), 1e-4
    for t in np.linspace(-0.05, 20.3, 41):
        before, now, after = (model.outputs({}, t + k * h) for k in (-1, 0, 1))
        for name, derivative in (("q_set", "qd_set"), ("qd_set", "qdd_set")):
            quotient = (vector(after, name) - vector(before, name)) / (2 * h)
            # fourth derivative (below 3e3) times h^2/6, and rounding over h
            np.testing.assert_allclose(vector(now, derivative), quotient, rtol=0, atol=5e-6)


def test_quintic_starts_and_ends_at_rest() -> None:
    start, end = np.arange(6.0), np.arange(6.0)[::-1]
    values = named(q_start=start, q_end=end) | {"t_start": 1.0, "duration": 2.0}
    for t, pose in ((0.0, start), (1.0, start), (3.0, end), (9.0, end)):
        outputs = oracle("quintic").outputs(values, t)
        # 10 - 15 + 6 is exactly 1
        np.testing.assert_array_equal(vector(outputs, "q_set"), pose)
        np.testing.assert_array_equal(vector(outputs, "qd_set"), np.zeros(6))
        np.testing.assert_array_equal(vector(outputs, "qdd_set"), np.zeros(6))
    middle = oracle("quintic").outputs(values, 2.0)
    np.testing.assert_allclose(vector(middle, "q_set"), 2.5, rtol=1e-15)  # rounding
    # largest speed is 15/8 of the mean one; rounding
    np.testing.assert_allclose(vector(middle, "qd_set"), 1.875 * (end - start) / 2, rtol=1e-14)


def test_swing_moves_joint_1_alone() -> None:
    times = np.linspace(0, 10, 401)
    q = np.array([vector(oracle("swing").outputs({}, t), "q_set") for t in times])
    assert np.abs(q[:, 0] - q[0, 0]).max() == pytest.approx(0.3, rel=1e-3)  # grid of 25 ms
    np.testing.assert_array_equal(q[:, 1:], np.tile(q[0, 1:], (401, 1)))
    np.testing.assert_array_equal(q[0], q[-1])


def test_multisine_spectra_do_not_overlap() -> None:
    """Over one period 1/f, without ramps: five lines per joint, each line in one joint only."""
    values = {"ramp": 1e-3, "duration": 100.0, "t_start": -30.0}
    times = np.arange(1024) * 20 / 1024
    q = np.array([vector(oracle("multisine").outputs(values, t), "q_set") for t in times])
    lines = np.abs(np.fft.rfft(q - q.mean(0), axis=0)) / 512 > 1e-9
    assert lines.sum(axis=0).tolist() == [5] * 6
    assert lines.sum(axis=1).max() == 1
    amplitudes = np.abs(np.fft.rfft(q, axis=0)) / 512
    np.testing.assert_allclose(amplitudes[1:31].sum(axis=0), 0.5, rtol=1e-9)  # whole periods
