"""Eq 1 of the digital twin paper: a base driven by the set speeds turns as commanded."""

from __future__ import annotations

import math

import pytest

from tests.support import Stepper, oracle_of

R, TRACK, RATIO = 0.100, 0.410, 10.167  # digital twin paper, Table 1

STILL = {"v_d": 0.0, "w_d": 0.0, "xd_d": 0.0, "yd_d": 0.0, "phi_d": 0.0}
"""Set motion of a base that stands; alone, it moves."""


def base_motion(outputs: dict[str, float]) -> tuple[float, float]:
    """Speed and yaw rate of a rigid base whose wheels roll: its wheel centres move with r w / N."""
    left, right = (R / RATIO * outputs[name] for name in ("w_l_ref", "w_r_ref"))
    return 0.5 * (left + right), (right - left) / TRACK


@pytest.mark.slow
@pytest.mark.parametrize("fidelity", ["body", "world"])
def test_base_turns_by_the_commanded_angle(fidelity: str) -> None:
    speed, radius = 0.4, 2.0
    values = {f"curvature[{k}]": 1.0 / radius for k in (1, 2, 3, 4)}
    values |= {"speed[1]": speed, "duration[1]": 0.5 * math.pi * radius / speed}
    trajectory = Stepper("trajectory.cn1/world", values, max_step=0.01)
    kinematics = Stepper(f"inverse_kinematics/{fidelity}")
    distance = angle = 0.0
    steps, dt = 1200, 0.01
    for _ in range(steps):
        # The rectangle rule of a trapezoid is exact up to its corners between grid points.
        set_motion = trajectory.step({}, dt)
        v, w = base_motion(kinematics.step(set_motion, dt))
        distance += v * dt
        angle += w * dt
    # Corners: at most DT^2 times the change of slope (a = 0.5 m/s2) at each of four corners.
    corners = 4 * dt**2 * 0.5
    assert distance == pytest.approx(0.5 * math.pi * radius, abs=corners)
    assert angle == pytest.approx(0.5 * math.pi, abs=corners / radius)  # with a = track: pi


def test_half_the_track_is_the_lever() -> None:
    for fidelity in ("body", "world"):
        oracle = oracle_of(f"inverse_kinematics/{fidelity}")
        spot = oracle.outputs({**STILL, "w_d": 1.0})
        # The right wheel of a base turning on the spot runs on a circle of half the track.
        assert spot["w_r_ref"] == pytest.approx(RATIO * 0.205 / 0.1, rel=1e-15)
        assert spot["w_l_ref"] == -spot["w_r_ref"]


def test_world_form_uses_the_set_heading_and_loses_the_sideways_part() -> None:
    oracle = oracle_of("inverse_kinematics/world")
    turned = {**STILL, "phi_d": 0.8}
    along = oracle.outputs({**turned, "xd_d": 0.3 * math.cos(0.8), "yd_d": 0.3 * math.sin(0.8)})
    assert along["w_l_ref"] == pytest.approx(RATIO * 0.3 / R, rel=1e-15)
    across = oracle.outputs({**turned, "xd_d": -math.sin(0.8), "yd_d": math.cos(0.8)})
    assert across["w_l_ref"] == pytest.approx(0.0, abs=1e-14)  # sin cos - cos sin, times 100


def test_controller_constants_may_be_wrong() -> None:
    oracle = oracle_of("inverse_kinematics.lab/body")
    outputs = oracle.outputs({"v_d": 0.5, "w_d": 0.4, "track": 0.400})
    # A base with the true track turns less by the ratio of the tracks.
    assert base_motion(outputs)[1] == pytest.approx(0.4 * 0.400 / TRACK, rel=1e-14)
