"""Commanded motion: distances and angles of the profiles are those that the parameters say."""

from __future__ import annotations

import numpy as np
import pytest

from sources.variant import build_model, device_values, devices
from tests.support import Stepper, oracle_of

DT = 0.01  # all ramps below begin and end on multiples of it

# Polynomials of the time up to degree 3 between grid points: RK4 and Simpson's rule integrate them
# exactly, so only rounding over some 1500 steps remains.
ROUNDING = 1e-12


def record(
    variant: str, steps: int, values: dict[str, float] | None = None
) -> dict[str, np.ndarray]:
    return Stepper(variant, values, max_step=DT).run(DT, steps)


def integral(time: np.ndarray, y: np.ndarray) -> float:
    """Trapezoidal rule, exact for piecewise linear signals with their corners on the grid."""
    return float(np.sum(0.5 * (y[1:] + y[:-1]) * np.diff(time)))


@pytest.mark.slow
@pytest.mark.parametrize("fidelity", ["body", "world"])
@pytest.mark.parametrize("device", sorted(devices("trajectory")))
def test_one_segment_covers_speed_times_duration(device: str, fidelity: str) -> None:
    given = {name: origin.value for name, origin in device_values("trajectory", device).items()}
    speed, duration, curvature = (given[k][0] for k in ("speed", "duration", "curvature"))
    end = given["t_0"] + duration + speed / given["a"]
    run = record(f"trajectory.{device}/{fidelity}", round(end / DT) + 20)
    assert integral(run["time"], run["v_d"]) == pytest.approx(speed * duration, abs=ROUNDING)
    assert run["phi_d"][-1] == pytest.approx(curvature * speed * duration, abs=ROUNDING)
    assert run["v_d"][-1] == 0.0 and run["w_d"][-1] == 0.0
    assert run["v_d"].max() == pytest.approx(speed, rel=1e-15)  # a sum of two terms
    before = run["time"] <= given["t_0"]
    assert before.sum() > 10 and not run["v_d"][before].any()


@pytest.mark.slow
def test_smooth_ramps_keep_the_distance_and_raise_the_acceleration_by_half() -> None:
    # Mean of the parabola 1.5 a over DT beside its peak; the ramp lasts 0.6 s.
    beside = 0.75 * (1 - 4 / 3 * (DT / 0.6) ** 2)
    for smooth, peak in ((0.0, 0.5), (1.0, beside)):
        run = record("trajectory.in1/body", 1300, {"smooth": smooth})
        # The trapezoidal rule is exact for the S ramp too: the errors of its halves cancel.
        assert integral(run["time"], run["v_d"]) == pytest.approx(3.0, abs=ROUNDING)
        acceleration = np.abs(np.diff(run["v_d"])).max() / DT
        assert acceleration == pytest.approx(peak, rel=1e-12)  # a difference of speeds over DT


def test_arc_is_a_circle_of_the_given_radius() -> None:
    run = record("trajectory.cn1/body", 1300)
    half = 0.5 * (run["phi_d"][1:] + run["phi_d"][:-1])
    # Chord of a circle: 2 R sin(dphi / 2) along the mean heading; here from speed and yaw rate.
    arc = 0.5 * (run["v_d"][1:] + run["v_d"][:-1]) * np.diff(run["time"])
    dphi = np.diff(run["phi_d"])
    chord = arc * np.sinc(dphi / (2 * np.pi))
    x, y = np.cumsum(chord * np.cos(half)), np.cumsum(chord * np.sin(half))
    radius = np.hypot(x, y - 2.0)
    # v and w are proportional at all times, so every step is on the circle up to rounding.
    assert np.abs(radius - 2.0).max() < ROUNDING


def test_segments_follow_each_other() -> None:
    values = {
        "speed[1]": 0.4,
        "speed[2]": 0.8,
        "speed[3]": -0.2,
        "speed[4]": 0.0,
        "duration[1]": 3.0,
        "duration[2]": 2.0,
        "duration[3]": 4.0,
        "duration[4]": 1.0,
        **{f"curvature[{k}]": 0.0 for k in (1, 2, 3, 4)},
        "turn[4]": 0.5,
        "alpha": 1.0,
        "a": 0.5,
        "t_0": 0.5,
    }
    run = record("trajectory/body", 1400, values)
    # Independent: each change of speed acts from its start, less half its ramp, to the end.
    starts, speeds = (0.5, 3.5, 5.5, 9.5), (0.4, 0.8, -0.2, 0.0)
    end = run["time"][-1]
    distance, last = 0.0, 0.0
    for start, speed in zip(starts, speeds, strict=True):
        distance += (speed - last) * (end - start - 0.5 * abs(speed - last) / 0.5)
        last = speed
    assert integral(run["time"], run["v_d"]) == pytest.approx(distance, abs=ROUNDING)
    assert run["phi_d"][-1] == pytest.approx(0.5 * 1.0, abs=ROUNDING)  # turn times duration
    assert run["v_d"][round(7.9 / DT)] == pytest.approx(-0.2, abs=1e-15)


def test_straight_then_arc_turns_by_the_curvature_of_what_is_driven() -> None:
    values = {
        **{f"speed[{k}]": 0.5 for k in (1, 2)},
        "duration[1]": 4.0,
        "duration[2]": 6.0,
        "curvature[1]": 0.0,
        "t_curve": 0.5,
        **{f"curvature[{k}]": 0.6 for k in (2, 3, 4)},
    }
    run = record("trajectory/body", 1400, values)
    straight = run["time"] <= 5.0
    assert not run["w_d"][straight].any()
    # Driven in the arc: 6 s and the stop of 1 s at half speed; the change of curvature at full
    # speed costs half of t_curve.
    expected = 0.6 * 0.5 * (6.0 + 0.5 - 0.25)
    assert run["phi_d"][-1] == pytest.approx(expected, abs=ROUNDING)


@pytest.mark.slow
def test_world_and_body_agree_and_crab_loses_the_sideways_part() -> None:
    values = {"heading": 0.7}
    body, world = (record(f"trajectory.cn2/{f}", 1100, values) for f in ("body", "world"))
    for name in ("v_d", "w_d", "xd_d", "yd_d", "phi_d"):
        assert world[name] == pytest.approx(body[name], abs=1e-14)  # projection and back
    crab = record("trajectory.cn2/world", 1100, {"crab": 0.3})
    speed = np.hypot(crab["xd_d"], crab["yd_d"])
    assert speed.max() == pytest.approx(0.5, rel=1e-14)
    assert crab["v_d"] == pytest.approx(speed * np.cos(0.3), abs=1e-14)  # rounding
    sideways = -np.sin(crab["phi_d"]) * crab["xd_d"] + np.cos(crab["phi_d"]) * crab["yd_d"]
    assert sideways == pytest.approx(speed * np.sin(0.3), abs=1e-14)


@pytest.mark.parametrize("fidelity", ["body", "world", "external"])
def test_commands_from_outside_pass_through(fidelity: str) -> None:
    silent = {f"speed[{k}]": 0.0 for k in (1, 2, 3, 4)} if fidelity != "external" else {}
    stepper = Stepper(f"trajectory/{fidelity}", silent)
    rng = np.random.default_rng(3)
    turned = 0.0
    for _ in range(50):
        v, w = rng.uniform(-1, 1, 2)
        out = stepper.step({"v_set": v, "w_set": w}, DT)
        turned += w * DT
        assert out["v_d"] == pytest.approx(v, abs=1e-15) and out["w_d"] == w  # cos^2 + sin^2
        assert out["phi_d"] == pytest.approx(turned, abs=1e-14)  # sums of 50 terms
        assert out["xd_d"] == pytest.approx(v * np.cos(turned), abs=1e-14)


def test_outputs_are_finite_where_segments_are_empty() -> None:
    zero = {
        name: 0.0
        for name in (v.name for v in build_model("trajectory/body").of_role("parameter"))
        if name.startswith(("duration", "speed", "turn"))
    }
    oracle = oracle_of("trajectory/body")
    for t in (0.0, 1.0, 2.0):
        assert np.all(np.isfinite(list(oracle.outputs(zero, t).values())))
        jacobian, time = oracle.functions.jacobian(*oracle.arguments(zero, t))[1:]
        assert np.all(np.isfinite(np.asarray(jacobian))) and np.all(np.isfinite(np.asarray(time)))
