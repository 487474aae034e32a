"""Encoder and current sensor against independent computations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from tests.support import Stepper

TAU = 1 / (2 * math.pi * 2000)


@pytest.mark.parametrize(
    ("device", "counts", "window"),
    [
        ("motor_bench", 65536, 1e-3),
        ("crawler", 25600, 0.02),
        ("mobile_manipulator", 41644.032, 0.01),
    ],
)
def test_encoder_speed_is_the_count_difference_over_the_window(
    device: str, counts: float, window: float
) -> None:
    stepper = Stepper(f"encoder.{device}/counts")
    rng = np.random.default_rng(1)
    substeps, samples = 20, 40
    dt = window / substeps
    w = 5.0 * np.sin(np.linspace(0, 9, samples * substeps)) + rng.normal(0, 0.5, samples * substeps)
    measured = []
    for k, speed in enumerate(w):
        outputs = stepper.step({"w": float(speed)}, dt)
        if (k + 1) % substeps == 0:
            measured.append(outputs["w_meas"])
    angle = np.concatenate([[0.0], np.cumsum(w * dt)])[::substeps]
    count = np.floor(angle * counts / (2 * math.pi) + 0.5)
    expected = np.diff(count) * 2 * math.pi / counts / window
    # From the second window on (before the start constant speed is assumed): rounding only.
    assert measured[1:] == pytest.approx(expected[1:], abs=1e-9)
    assert np.count_nonzero(np.diff(expected)) > 10


def test_encoder_resolutions_are_those_of_the_rig_sheets() -> None:
    printed = {"motor_bench": 0.0959, "crawler": 0.0123, "mobile_manipulator": 0.0151}
    for device, step in printed.items():
        stepper = Stepper(f"encoder.{device}/counts")
        window = stepper.values["window"]
        seen = {round(stepper.step({"w": 0.3 * step}, window)["w_meas"], 12) for _ in range(12)}
        seen.discard(0.0)
        assert len(seen) == 1
        assert seen.pop() == pytest.approx(step, abs=5e-5)  # four decimals are printed


@pytest.mark.slow
def test_encoder_mean_speed_is_unbiased_and_the_window_moves() -> None:
    stepper = Stepper("encoder.crawler/counts")
    speed, resolution = 0.987, 2 * math.pi / 25600 / 0.02
    read = np.array([stepper.step({"w": speed}, 0.0011)["w_meas"] for _ in range(2000)])
    assert np.abs(read - speed).max() < 1.0001 * resolution  # a difference of two floors
    # Uniformly spread phases: sd of the mean at most resolution / sqrt(2000 / 18), reads overlap.
    assert read.mean() == pytest.approx(speed, abs=resolution / 10)


def test_encoder_angle_is_quantised_without_a_delay() -> None:
    stepper = Stepper("encoder.motor_bench_resolver/counts")
    step = 2 * math.pi / 4096
    for angle in (0.3, -1.7, 40.0):
        read = stepper.step({"phi": angle}, 1e-3)["phi_meas"]
        assert abs(read - angle) <= 0.5 * step
        assert read / step == pytest.approx(round(read / step), abs=1e-9)  # a whole count


def test_current_sensor_has_a_time_constant_of_79_6_us() -> None:
    assert pytest.approx(79.6e-6, abs=0.05e-6) == TAU  # the figure of the paper, three digits
    stepper = Stepper("current_sensor/first_order", max_step=TAU / 100)
    assert stepper.step({"i": 2.0}, TAU)["i_meas"] == pytest.approx(
        2 * (1 - math.exp(-1)),
        rel=1e-9,  # RK4 with 100 steps per time constant: 1e-10
    )


def test_averaging_is_the_mean_of_the_filtered_current() -> None:
    dt, window = 1e-4, 0.01
    stepper = Stepper("current_sensor.mobile_manipulator/averaging", max_step=1e-5)
    rng = np.random.default_rng(5)
    current = np.repeat(rng.uniform(-20, 20, 80), 7)[:500]
    read = np.array([stepper.step({"i": float(i)}, dt)["i_meas"] for i in current])
    # Exact filter of a held signal, and its integral over each step.
    decay = math.exp(-dt / TAU)
    after = lfilter([1 - decay], [1, -decay], current)
    before = np.concatenate([[0.0], after[:-1]])
    charge = np.cumsum(current * dt + (before - current) * TAU * (1 - decay))
    expected = (charge[100:] - charge[:-100]) / window
    # The charge is sampled ten times per window: compare there. n steps after a jump RK4 has an
    # error of n z^5/120 exp(-n z) of it, z = h/tau = 0.126: at most 8e-7, at both window ends.
    assert read[109::10] == pytest.approx(expected[9::10], abs=2 * 8e-7 * 40 * TAU / window)
    assert np.ptp(expected) > 5


def test_averaging_starts_from_rest_with_the_current_of_its_state() -> None:
    stepper = Stepper("current_sensor/averaging", {"i_f": 3.0, "i": 3.0})
    # A current that has always flowed: the mean does not have to fill up.
    read = [stepper.step({"i": 3.0}, 1e-3)["i_meas"] for _ in range(15)]
    assert read == pytest.approx([3.0] * 15, rel=1e-12)  # sums of charges


@pytest.mark.parametrize("component", ["encoder", "current_sensor"])
def test_ideal_sensor_reads_what_is(component: str) -> None:
    stepper = Stepper(f"{component}/ideal")
    if component == "encoder":
        outputs = stepper.step({"phi": 1.5, "w": -2.5}, 0.01)
        assert (outputs["phi_meas"], outputs["w_meas"]) == (1.5, -2.5)
    else:
        assert stepper.step({"i": -7.0}, 0.01)["i_meas"] == -7.0
