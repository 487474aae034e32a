"""Every fidelity of the omnidirectional base with every effect, and the pivot torque."""

from __future__ import annotations

import numpy as np
import pytest

from sources.tools.pivot import saturated_moment
from tests.attachments import (
    attachable,
    check_absence,
    check_energy,
    check_presence,
    check_rest,
    oracle,
)

pytestmark = pytest.mark.slow

PLAIN = ["omni_base/kinematic", "omni_base/dynamic", "omni_base/slip", "omni_base/creep"]
CASES = [name for plain in PLAIN for name in attachable(plain)]


def test_the_asked_effects_attach() -> None:
    for plain in PLAIN:
        for wanted in (
            "coulomb@steering",
            "coulomb@rolling",
            "viscous@steering",
            "viscous@rolling",
            "pivot_torque@pivot",
            "payload@body",
            "floor_slope@body",
            "turning_friction@body",
            "load_shift@load",
        ):
            assert f"{plain}+{wanted}" in CASES
    assert "omni_base/slip+low_friction_patch@mu" in CASES


@pytest.mark.parametrize("name", PLAIN)
def test_plain(name: str) -> None:
    check_energy(name)
    check_rest(name)


@pytest.mark.parametrize("name", CASES)
def test_effect(name: str) -> None:
    check_energy(name)
    check_absence(name)
    check_rest(name)
    if "kinematic" not in name:
        check_presence(name)


def accelerations(variant: str, **values: float) -> np.ndarray:
    d = oracle(variant).derivatives(values)
    return np.array([d["vel_x"], d["vel_y"], d["yaw_rate"]])


@pytest.mark.parametrize("k", [1.0, 1e4])
def test_pivot_torque_acts_on_steering_and_yaw_and_opposes_the_spin(k: float) -> None:
    # K = 1e4 N.m2 is the paper's constant torque M_pa, 1 N.m2 its torque against spin over speed
    name = "omni_base/slip+pivot_torque"
    full, bare = oracle(name), oracle("omni_base/slip")
    state = {
        "yaw_rate": 0.4,
        "steering_rate[1]": 0.3,
        "steering_rate[2]": -0.9,
        "steering_rate[3]": -0.4,
        "rolling_rate[1]": 2.0,
        "rolling_rate[2]": -3.0,
    }
    limit = 6.0
    some = full.derivatives({**state, "pivot_torque.M_pa": limit, "pivot_torque.K": k})
    none = bare.derivatives(state)
    i_beta, spin = 0.05 + 10 * 0.06**2, np.array([0.7, -0.5, 0.0])
    rolling = np.array([0.2, 0.3, 0.0])
    # the steering equation by hand: I_beta beta'' + G^T xi'' = moment, at theta = beta = 0
    change = {key: some[key] - none[key] for key in none}
    moments = np.array(
        [
            saturated_moment(k, limit, s, v, 0.005) if s else 0.0
            for s, v in zip(spin, np.hypot(rolling, 0.005), strict=True)
        ]
    )
    x = 0.35 * np.cos([np.pi / 3, np.pi, 5 * np.pi / 3])
    lever = 0.05 + 10 * (0.06**2 - 0.06 * x)  # G3 at beta = 0
    for i in range(3):
        steering = (
            i_beta * change[f"steering_rate[{i + 1}]"]
            + lever[i] * change["yaw_rate"]
            - 10 * 0.06 * change["vel_y"]
        )
        assert steering == pytest.approx(moments[i], abs=1e-9 * limit)
    assert np.all(moments * spin <= 0)
    if k > 1e3:
        np.testing.assert_allclose(np.abs(moments[:2]), limit, rtol=1e-6)
    out = full.outputs({**state, "pivot_torque.M_pa": limit, "pivot_torque.K": k})
    assert out["pivot_torque.P_loss"] == pytest.approx(-np.dot(moments, spin), rel=1e-9)


@pytest.mark.parametrize("fidelity", ["slip", "creep"])
def test_platform_and_forks_slide_down_a_slope_together(fidelity: str) -> None:
    """As all bodies fall alike: at rest no tyre pulls, so nothing turns."""
    turned = {
        f"steering_angle[{i}]": angle for i, angle in zip((1, 2, 3), (0.4, 2.0, -1.1), strict=True)
    }
    slope = {"floor_slope.slope": 0.02, "floor_slope.heading": 0.7, "pose_theta": 0.3}
    still = {name: 0.0 for name in ("f_s", "f_v") if fidelity != "creep"}
    lift = {"payload.mass": 20.0, "payload.position[1]": 0.2, "payload.position[2]": -0.1}
    rates = oracle(f"omni_base/{fidelity}+payload+floor_slope").derivatives(
        {**turned, **slope, **still, **lift}
    )
    along = -9.81 * np.sin(0.02)
    spins = [rates["yaw_rate"], *(rates[f"steering_rate[{i}]"] for i in (1, 2, 3))]
    assert rates["vel_x"] == pytest.approx(along * np.cos(0.7), rel=1e-9)
    assert rates["vel_y"] == pytest.approx(along * np.sin(0.7), rel=1e-9)
    assert spins == pytest.approx(np.zeros(4), abs=1e-9)  # rounding of solves of 2500 N


def test_payload_and_slope_move_the_base_as_they_should() -> None:
    still = {"f_s": 0.0, "f_v": 0.0}
    # gravity along the slope, 250 kg; the inertia reflected from the wheels is 1 to 3 percent
    down = accelerations("omni_base/kinematic+floor_slope", **still, **{"floor_slope.slope": 0.01})
    assert down[0] == pytest.approx(-9.81 * np.sin(0.01), rel=0.05)
    assert down[1] == pytest.approx(0.0, abs=1e-12)
    push = {f"tau_phi[{i}]": -1.0 for i in (1, 2, 3)}
    light = accelerations("omni_base/dynamic", **still, **push)
    heavy = accelerations("omni_base/dynamic+payload", **still, **push, **{"payload.mass": 250.0})
    assert heavy[0] / light[0] == pytest.approx(0.5, abs=0.02)
