"""Currents of an arm that is moved as given, against pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from sources.variant import device_values
from tests.arm.chains import named, vector
from tests.support import oracle_of


def device() -> dict[str, np.ndarray]:
    """The device's values; its links are points, so each gets an inertia of its own on top."""
    values = {k: np.asarray(v.value) for k, v in device_values("moved_arm", "ur10e").items()}
    own = {"J_xx": 0.10, "J_yy": 0.12, "J_zz": 0.15, "J_xy": 0.01, "J_xz": -0.02, "J_yz": 0.015}
    return values | {name: values[name] + inertia for name, inertia in own.items()}


def reference(values: dict[str, np.ndarray]) -> pin.Model:
    """The links in pinocchio, from first moments and inertias about the joints."""
    model = pin.Model()
    joint, place = 0, pin.SE3.Identity()
    for k in range(6):
        joint = model.addJoint(joint, pin.JointModelRZ(), place, f"joint_{k + 1}")
        mass = float(values["mass"][k])
        centre = np.array([values[name][k] for name in ("h_x", "h_y", "h_z")]) / mass
        xx, yy, zz, xy, xz, yz = (
            values[f"J_{name}"][k] for name in ("xx", "yy", "zz", "xy", "xz", "yz")
        )
        about_joint = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        shift = mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        inertia = pin.Inertia(mass, centre, about_joint - shift)
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
        turn = pin.exp3(np.array([values["alpha"][k], 0.0, 0.0]))
        place = pin.SE3(turn, np.array([values["a"][k], 0.0, values["d"][k]]))
    return model


@pytest.mark.parametrize("seed", range(3))
def test_currents_are_inverse_dynamics_and_friction(seed: int) -> None:
    rng = np.random.default_rng(seed)
    q, qd, qdd = rng.normal(size=(3, 6))
    values = device()
    oracle = oracle_of("moved_arm/rigid")
    inertias = named(**{name: values[name] for name in values if name.startswith("J_")})
    outputs = oracle.outputs({**named(q=q, qd=qd, qdd=qdd), **inertias, "w_0": 0.1})
    model = reference(values)
    rigid = pin.rnea(model, model.createData(), q, qd, qdd)
    dry = values["F_c"] * np.tanh(qd / 0.1) + values["F_0"]
    expected = rigid + values["J_m"] * qdd + values["F_v"] * qd + dry
    # rounding of torques up to 200 N.m
    np.testing.assert_allclose(vector(outputs, "tau"), expected, rtol=0, atol=1e-10)
    np.testing.assert_allclose(vector(outputs, "i"), expected / values["K"], rtol=0, atol=1e-11)


def test_a_bristle_keeps_its_torque_when_the_arm_stops() -> None:
    """What Coulomb friction over the speed forgets: the torque of the last direction."""
    oracle = oracle_of("moved_arm/rigid+bristle@joint_5")
    stuck = {"joint_5.bristle.tau_c": 3.0, "joint_5.bristle.z": 0.8, **named(q=[0.1] * 6)}
    free = {"joint_5.bristle.tau_c": 0.0, **named(q=[0.1] * 6)}
    held = vector(oracle.outputs(stuck), "tau") - vector(oracle.outputs(free), "tau")
    np.testing.assert_allclose(held, [0, 0, 0, 0, 2.4, 0], atol=1e-12)  # rounding
