"""Printed check values of UR5 and UR5e: pinocchio, confirmed by an independent Newton-Euler.

No payload, no friction, no rotor inertia, level mount, g = 9.81. Wrench of the mount on the arm.
"""

from __future__ import annotations

from functools import lru_cache
from math import pi

import numpy as np
import pytest

from sources.function import Oracle
from tests.arm.chains import laws, named, vector
from tests.support import oracle_of

HALF_DIGIT = 5.1e-7  # the values are printed with six decimals

POSES = {
    "A": (np.zeros(6), np.zeros(6), np.zeros(6)),
    "B": (
        np.array([0.3, -1.1, 1.4, -0.8, 0.6, -0.4]),
        np.array([0.5, -0.4, 0.3, 0.2, -0.6, 0.7]),
        np.array([1, -0.8, 0.6, 0.5, -0.3, 0.2]),
    ),
    "C": (
        np.array([pi / 2, -0.1, 0.2, -0.1 - pi / 2, -pi / 2, 0]),
        np.array([1.2, 0, 0, 0, 0, 0]),
        np.array([2.0, 0, 0, 0, 0, 0]),
    ),
}
MOUNT = {
    "mount_velocity": (0.8, 0.0, 0.0),
    "mount_rate": (0.02, -0.03, 0.5),
    "mount_acceleration": (0.4, 0.4, 0.05),
    "mount_angular_acceleration": (0.1, -0.2, 0.3),
}
G = np.array([0.0, 0.0, 9.81])

# torques of joints 1-6; force; moment
FIXED = {
    ("ur5", "A"): (
        (0, -53.800216, -15.641572, 0, 0, 0),
        (0, 0, 167.249709, -13.144459, 53.800216, 0),
    ),
    ("ur5", "B"): (
        (1.503489, -34.832767, -15.733318, -0.815707, 0.110104, 0.000080),
        (5.481018, -0.055074, 168.385676, -22.484948, 29.992817, 1.503489),
    ),
    ("ur5", "C"): (
        (7.429714, -55.121258, -16.778107, -1.426611, 0.058248, -0.000264),
        (9.336597, 10.684582, 167.249709, -56.073519, -11.892162, 7.429714),
    ),
    ("ur5e", "A"): (
        (0, -59.756420, -18.439153, 0, 0, 0),
        (0, 0, 173.637000, -14.277524, 59.756420, 0),
    ),
    ("ur5e", "B"): (
        (1.805137, -39.586517, -18.647769, -1.070996, 0.179182, 0.000155),
        (6.034046, -0.195011, 174.888301, -24.854386, 34.718899, 1.805137),
    ),
    ("ur5e", "C"): (
        (9.034227, -61.385627, -19.820331, -1.734829, 0.093217, -0.000515),
        (10.480532, 11.792134, 173.637000, -63.300478, -11.930424, 9.034227),
    ),
}
MOVING = {
    ("ur5", "A"): (
        (-0.586376, -53.232962, -15.349000, 0.097881, -0.023612, 0.000026),
        (8.356187, 5.366538, 166.834919, -13.501731, 53.938228, -0.586376),
    ),
    ("ur5", "B"): (
        (1.303837, -36.596029, -15.093682, -0.692155, 0.090142, 0.000098),
        (13.850814, 8.403259, 168.550388, -24.679361, 32.087412, 1.303837),
    ),
    ("ur5", "C"): (
        (11.190871, -55.633380, -16.567264, -1.375074, 0.076521, -0.000304),
        (15.641124, 25.841987, 168.363771, -57.898604, -11.408494, 11.190871),
    ),
    ("ur5e", "A"): (
        (-0.521880, -59.033309, -18.078995, 0.119557, -0.037791, 0.000051),
        (8.552984, 5.322378, 173.115729, -14.994398, 60.385631, -0.521880),
    ),
    ("ur5e", "B"): (
        (1.546241, -41.431742, -17.876262, -0.921572, 0.147841, 0.000187),
        (14.707649, 8.520995, 174.988025, -27.801055, 37.537235, 1.546241),
    ),
    ("ur5e", "C"): (
        (13.219318, -61.937242, -19.546828, -1.648022, 0.119938, -0.000592),
        (16.848122, 28.011512, 174.797691, -66.450077, -10.982821, 13.219318),
    ),
}
# tool position; rotation vector; kinetic and potential energy; centre of mass of the arm
PLACES = {
    ("ur5", "A"): (
        (-0.817250, -0.191450, -0.005491),
        (pi / 2, 0, 0),
        (0, 12.502046),
        (-0.321676, -0.078592, 0.074751),
    ),
    ("ur5", "B"): (
        (-0.572144, -0.362338, 0.291220),
        (1.295018, 0.388485, -0.905511),
        (0.401711, 42.161496),
        (-0.166133, -0.133280, 0.252087),
    ),
    ("ur5", "C"): (
        (0.109150, -0.907817, 0.010129),
        (0, pi, 0),
        (2.674697, 15.885240),
        (0.076529, -0.328919, 0.094979),
    ),
    ("ur5e", "A"): (
        (-0.817200, -0.232900, 0.062800),
        (pi / 2, 0, 0),
        (0, 25.446007),
        (-0.344146, -0.082226, 0.146547),
    ),
    ("ur5e", "B"): (
        (-0.571244, -0.402285, 0.364827),
        (1.295018, 0.388485, -0.905511),
        (0.490534, 57.194372),
        (-0.182243, -0.141854, 0.329390),
    ),
    ("ur5e", "C"): (
        (0.133300, -0.912817, 0.066175),
        (0, pi, 0),
        (3.252322, 28.994255),
        (0.078996, -0.352937, 0.166982),
    ),
}
GRAVITY_B = {
    "ur5": (0, -33.132163, -15.823551, -0.880586, 0.136499, 0),
    "ur5e": (0, -37.509875, -18.768523, -1.152927, 0.221928, 0),
}
DIAGONAL_B = {
    "ur5": (1.680415, 2.264805, 0.684898, 0.017157, 0.003837, 0.000132),
    "ur5e": (2.041296, 2.818496, 0.854990, 0.020381, 0.005351, 0.000258),
}
WEIGHT = {"ur5": 167.249709, "ur5e": 173.637}


@lru_cache(maxsize=None)
def oracle(variant: str) -> Oracle:
    return oracle_of(variant)


def inverse(device: str, pose: str, mount: dict[str, tuple[float, ...]]) -> tuple[np.ndarray, ...]:
    zero = np.zeros(3)
    results = laws(device)["inverse"](
        *POSES[pose],
        mount.get("mount_rate", zero),
        np.array(mount.get("mount_acceleration", zero)) + G,
        mount.get("mount_angular_acceleration", zero),
    )
    return tuple(np.asarray(r).ravel() for r in results)


@pytest.mark.parametrize(("device", "pose"), FIXED)
def test_torques_and_wrench_on_a_fixed_mount(device: str, pose: str) -> None:
    tau, wrench = inverse(device, pose, {})
    torques, forces = FIXED[device, pose]
    np.testing.assert_allclose(tau, torques, rtol=0, atol=HALF_DIGIT)
    np.testing.assert_allclose(wrench, forces, rtol=0, atol=HALF_DIGIT)
    q, qd, qdd = POSES[pose]
    values = named(angle=q, speed=qd, tau=tau)
    model = oracle(f"ur5_arm.{device}/rigid")
    # forward undoes inverse; the wrist's inertia of 1e-4 amplifies rounding to about 1e-11
    rates = vector(model.derivatives(values), "speed")
    np.testing.assert_allclose(rates, qdd, rtol=0, atol=1e-9)
    given = vector(model.outputs(values), "wrench")
    np.testing.assert_allclose(given, forces, rtol=0, atol=HALF_DIGIT)
    assert wrench[5] == pytest.approx(tau[0], abs=1e-12)  # moment about joint 1; rounding


@pytest.mark.parametrize(("device", "pose"), MOVING)
def test_torques_and_wrench_on_a_moving_mount(device: str, pose: str) -> None:
    tau, wrench = inverse(device, pose, MOUNT)
    torques, forces = MOVING[device, pose]
    np.testing.assert_allclose(tau, torques, rtol=0, atol=HALF_DIGIT)
    np.testing.assert_allclose(wrench, forces, rtol=0, atol=HALF_DIGIT)
    q, qd, qdd = POSES[pose]
    values = named(angle=q, speed=qd, tau=tau, **MOUNT)
    model = oracle(f"ur5_arm.{device}/rigid_moving")
    # as above
    rates = vector(model.derivatives(values), "speed")
    np.testing.assert_allclose(rates, qdd, rtol=0, atol=1e-9)
    given = vector(model.outputs(values), "wrench")
    np.testing.assert_allclose(given, forces, rtol=0, atol=HALF_DIGIT)


@pytest.mark.parametrize(
    "fidelity", ["kinematic", "rigid", "ticked", "ticked_elastic", "rigid_moving", "elastic"]
)
@pytest.mark.parametrize(("device", "pose"), PLACES)
def test_tool_and_energy(device: str, pose: str, fidelity: str) -> None:
    position, rotation, energy, _ = PLACES[device, pose]
    q, qd, _ = POSES[pose]
    values = named(angle=q, speed=qd)
    if fidelity == "elastic":
        values |= {"J_hub": 1e-9}
    outputs = oracle(f"ur5_arm.{device}/{fidelity}").outputs(values)
    np.testing.assert_allclose(vector(outputs, "tool_position"), position, rtol=0, atol=HALF_DIGIT)
    turned = vector(outputs, "tool_rotation")
    if abs(np.linalg.norm(rotation) - pi) < 1e-6:
        turned = turned * np.sign(turned @ rotation)  # half a turn: both axes mean the same
    np.testing.assert_allclose(turned, rotation, rtol=0, atol=HALF_DIGIT)
    if fidelity != "kinematic":
        # J_hub adds less than 1e-8 J
        assert outputs["E_stored"] == pytest.approx(sum(energy), abs=2 * HALF_DIGIT)


@pytest.mark.parametrize(("device", "pose"), PLACES)
def test_centre_of_mass_and_weight(device: str, pose: str) -> None:
    mass, moment, _ = laws(device)["mass"](POSES[pose][0])
    centre = np.asarray(moment).ravel() / float(mass)
    np.testing.assert_allclose(centre, PLACES[device, pose][3], rtol=0, atol=HALF_DIGIT)
    assert 9.81 * float(mass) == pytest.approx(WEIGHT[device], abs=HALF_DIGIT)


@pytest.mark.parametrize("device", GRAVITY_B)
def test_gravity_torques_and_inertia_diagonal(device: str) -> None:
    zero = np.zeros(3)
    q = POSES["B"][0]
    tau, wrench = laws(device)["inverse"](q, np.zeros(6), np.zeros(6), zero, G, zero)
    np.testing.assert_allclose(np.asarray(tau).ravel(), GRAVITY_B[device], rtol=0, atol=HALF_DIGIT)
    assert float(wrench[2]) == pytest.approx(WEIGHT[device], abs=HALF_DIGIT)
    diagonal = np.diag(np.asarray(laws(device)["mass_matrix"](q)))
    np.testing.assert_allclose(diagonal, DIAGONAL_B[device], rtol=0, atol=HALF_DIGIT)
