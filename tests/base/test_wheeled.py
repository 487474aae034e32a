"""Bases on given wheel speeds: two wheels, three omni wheels, and the controller before them."""

from __future__ import annotations

import numpy as np
import pytest

from sources.function import Oracle
from tests.support import oracle_of

ANGLES = np.deg2rad([60.0, 180.0, 300.0])


def oracle(variant: str) -> Oracle:
    return oracle_of(variant)


def omni_speeds(v_x: float, v_y: float, w_z: float, r: float = 0.04, arm: float = 0.125) -> dict:
    rates = (-np.sin(ANGLES) * v_x + np.cos(ANGLES) * v_y + arm * w_z) / r
    return {f"w[{i}]": float(rate) for i, rate in enumerate(rates, 1)}


def test_mixer_and_base_are_inverse() -> None:
    told = oracle("wheel_mixer.create/ideal").outputs({"v_set": 0.2, "w_set": -0.7})
    done = oracle("diff_drive.create/rolling").outputs({"w_l": told["w_l"], "w_r": told["w_r"]})
    assert (done["v"], done["w_z"]) == pytest.approx((0.2, -0.7), rel=1e-12)  # rounding


def test_the_speed_limit_keeps_the_yaw_rate() -> None:
    limited = oracle("wheel_mixer.create/ideal+wheel_speed_limit@wheels")
    base = oracle("diff_drive.create/rolling")
    limit = 0.1 / 0.033  # 0.1 m/s
    for v_set, w_set, v in ((0.086, 0.4, 0.1 - 0.129 * 0.4), (0.05, 0.2, 0.05),
                            (-0.086, 0.4, -0.1 + 0.129 * 0.4), (0.2, 0.0, 0.1)):  # fmt: skip
        told = {"v_set": v_set, "w_set": w_set}
        name = "wheels.wheel_speed_limit"
        wheels = limited.outputs({**told, f"{name}.slowness": 1 / limit, f"{name}.keep": 1.0})
        assert max(abs(wheels["w_l"]), abs(wheels["w_r"])) <= limit * (1 + 1e-12)
        done = base.outputs({key: wheels[key] for key in ("w_l", "w_r")})
        assert (done["v"], done["w_z"]) == pytest.approx((v, w_set), abs=1e-12)  # rounding
    cut = limited.outputs(
        {"v_set": 0.086, "w_set": 0.4, f"{name}.slowness": 1 / limit, f"{name}.keep": 0.0}
    )
    assert cut["w_r"] == pytest.approx(limit) and cut["w_l"] == pytest.approx(
        (0.086 - 0.129 * 0.4) / 0.033
    )


def test_omni_wheels_roll_whatever_the_loads() -> None:
    base = oracle("omni_wheels.robotino/rolling")
    got = base.outputs({**omni_speeds(0.1, -0.2, 0.3), "load[2]": 90.0})
    assert (got["v_x"], got["v_y"], got["w_z"]) == pytest.approx((0.1, -0.2, 0.3), rel=1e-12)


def test_drag_of_the_rollers_takes_its_share_by_direction() -> None:
    base = oracle("omni_wheels.robotino/rolling+roller_drag")
    equal = {f"load[{i}]": 30.0 for i in (1, 2, 3)} | {"roller_drag.rho": 0.25}
    got = base.outputs({**omni_speeds(0.1, -0.2, 0.3), **equal})
    # equal loads: translation over 1 + rho in every direction, turning is free of drag
    assert (got["v_x"], got["v_y"]) == pytest.approx((0.08, -0.16), rel=1e-12)
    assert got["w_z"] == pytest.approx(0.3, rel=1e-12)
    # a heavy second wheel (driven along y): sums of load sin^2 and load cos^2, turning held back
    loads = np.array([30.0, 50.0, 30.0])
    for direction, drive, drag in (
        ("v_x", loads @ np.sin(ANGLES) ** 2, loads @ np.cos(ANGLES) ** 2),
        ("v_y", loads @ np.cos(ANGLES) ** 2, loads @ np.sin(ANGLES) ** 2),
    ):
        told = omni_speeds(*(0.1 * (direction == "v_x"), 0.1 * (direction == "v_y"), 0.0))
        unequal = {f"load[{i}]": float(load) for i, load in enumerate(loads, 1)}
        got = base.outputs({**told, **unequal, "roller_drag.rho": 0.25})
        assert got[direction] <= 0.1 * drive / (drive + 0.25 * drag) + 1e-12
    # along x nothing couples to turning: the two outer wheels are equal
    told = omni_speeds(0.1, 0.0, 0.0)
    got = base.outputs({**told, **unequal, "roller_drag.rho": 0.25})
    drive, drag = loads @ np.sin(ANGLES) ** 2, loads @ np.cos(ANGLES) ** 2
    assert got["v_x"] == pytest.approx(0.1 * drive / (drive + 0.25 * drag), rel=1e-12)


def test_a_tricycle_turns_about_the_crossing_of_its_axles() -> None:
    base = oracle("tricycle.sapienza/rolling")
    told = {"steer": 0.5, "w": 2.0, "ratio": 1.2, "r": 0.1, "l": 1.5}
    got = base.outputs(told)
    radius = 1.5 / np.tan(0.6)
    assert got["v"] == pytest.approx(got["w_z"] * radius, rel=1e-12)  # rounding
    # the driven wheel itself does r w about the same point
    assert got["w_z"] * np.hypot(radius, 1.5) == pytest.approx(0.2, rel=1e-12)
    across = base.outputs({**told, "steer": np.pi / 2 / 1.2})
    assert across["v"] == pytest.approx(0.0, abs=1e-12)
    assert across["w_z"] == pytest.approx(0.2 / 1.5, rel=1e-12)


def mecanum_speeds(v_x: float, v_y: float, w_z: float, r: float = 0.07, arm: float = 0.369) -> dict:
    rates = [v_x - v_y - arm * w_z, v_x + v_y + arm * w_z, v_x + v_y - arm * w_z,
             v_x - v_y + arm * w_z]  # fmt: skip
    return {f"w[{i}]": rate / r for i, rate in enumerate(rates, 1)}


def test_mecanum_wheels_roll_as_in_the_book() -> None:
    base = oracle("mecanum_wheels.polimi/rolling")
    got = base.outputs({**mecanum_speeds(0.3, -0.2, 0.5), "load[1]": 90.0})
    assert (got["v_x"], got["v_y"], got["w_z"]) == pytest.approx((0.3, -0.2, 0.5), rel=1e-12)


def test_drag_of_mecanum_rollers_leaves_straight_driving_alone() -> None:
    base = oracle("mecanum_wheels.polimi/rolling+roller_drag")
    straight = base.outputs({**mecanum_speeds(0.3, 0.0, 0.0), "roller_drag.rho": 0.2})
    assert (straight["v_x"], straight["v_y"]) == pytest.approx((0.3, 0.0), abs=1e-12)
    # sideways, at 45 degrees: slip along v_y - r w ... and run across v_y + r w balance,
    # (v - u) + rho (v + u) = 0 with u the speed of the wheels
    aside = base.outputs({**mecanum_speeds(0.0, 0.3, 0.0), "roller_drag.rho": 0.2})
    assert aside["v_y"] == pytest.approx(0.3 * (1 - 0.2) / (1 + 0.2), rel=1e-12)
