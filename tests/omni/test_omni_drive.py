"""The drive of the omnidirectional base: its torques move the base as they are meant to."""

from __future__ import annotations

import numpy as np
import pytest

from sources.function import Oracle
from sources.tools.omni_torques import torques
from tests.support import oracle_of

BASE = oracle_of("omni_base/dynamic")
RNG = np.random.default_rng(4)


def known(oracle: Oracle, values: dict[str, float]) -> dict[str, float]:
    """Those of the values that this fidelity has variables for."""
    roles = ("state", "input", "parameter")
    names = {v.name for role in roles for v in oracle.model.of_role(role)}
    return {name: value for name, value in values.items() if name in names}


def vector(name: str, values: np.ndarray) -> dict[str, float]:
    return {f"{name}[{i + 1}]": float(v) for i, v in enumerate(values)}


def point() -> tuple[dict[str, float], dict[str, float], np.ndarray, np.ndarray]:
    """Inputs of the drive and states of the base at one random motion, and rates, accelerations."""
    theta, beta = RNG.normal(), RNG.uniform(-3, 3, 3)
    rates, acceleration = RNG.normal(size=3), RNG.normal(size=3)
    measured = {"theta": theta, "xd": rates[0], "yd": rates[1], "thetad": rates[2]}
    wanted = {"theta_set": theta, "xd_set": rates[0], "yd_set": rates[1], "thetad_set": rates[2]}
    wanted |= dict(zip(("xdd_set", "ydd_set", "thetadd_set"), acceleration, strict=True))
    states = {"pose_theta": theta, "vel_x": rates[0], "vel_y": rates[1], "yaw_rate": rates[2]}
    inputs = measured | wanted | vector("beta", beta) | vector("steering_angle", beta)
    return inputs, states | vector("steering_angle", beta), rates, acceleration


@pytest.mark.parametrize("fidelity", ["inverse_dynamics", "pid"])
def test_torques_give_the_set_acceleration(fidelity: str) -> None:
    drive = oracle_of(f"omni_drive/{fidelity}")
    for _ in range(5):
        inputs, states, _, acceleration = point()
        found = drive.outputs(known(drive, inputs | {"tau_max": 1e6}))
        given = {k: v for k, v in found.items() if k.startswith("tau_")}
        rates = BASE.derivatives(states | given)
        # the same equations forwards and backwards, solved twice: rounding of 250 kg systems
        np.testing.assert_allclose(
            [rates["vel_x"], rates["vel_y"], rates["yaw_rate"]], acceleration, atol=1e-10
        )


def test_torques_are_those_of_the_tool() -> None:
    drive = oracle_of("omni_drive/inverse_dynamics")
    inputs, _, rates, acceleration = point()
    beta = [inputs[f"beta[{i}]"] for i in (1, 2, 3)]
    expected = torques(inputs["theta"], beta, rates, acceleration)
    found = drive.outputs(inputs)
    for name, want in zip(("tau_beta", "tau_phi"), expected, strict=True):
        # one implementation, with the values of one device: only the order of rounding differs
        np.testing.assert_allclose([found[f"{name}[{i}]"] for i in (1, 2, 3)], want, rtol=1e-12)


def test_pid_answers_an_error_and_keeps_its_limit() -> None:
    drive = oracle_of("omni_drive/pid")
    limited = drive.outputs({"x_set": 10.0, "tau_max": 30.0})
    assert max(abs(limited[f"tau_phi[{i}]"]) for i in (1, 2, 3)) == 30.0
    near = drive.outputs({"x_set": 0.01})
    # 0.01 m x 75 1/s2 on the base along its wheels: only the rolling motors push, forward is -phi
    rates = BASE.derivatives({k: v for k, v in near.items() if k.startswith("tau_")})
    assert rates["vel_x"] == pytest.approx(0.75, rel=1e-9)  # solved twice: rounding
    assert abs(rates["vel_y"]) < 1e-9
