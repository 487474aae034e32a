"""Kinematics and dynamics of the omnidirectional base against Lagrange's equations and numbers."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np
import pytest

from sources.function import Oracle
from sources.omni_base.rigid_body import (
    Geometry,
    Masses,
    inertia_blocks,
    joint_map,
    mean_inertia,
    reduced,
    rotation,
    velocity_forces,
)
from sources.tools import omni_kinematics
from sources.tools.omni_torques import torques
from tests.omni import lagrange as la
from tests.support import oracle_of

FREE = {"f_s": 0.0, "f_v": 0.0}  # no axle friction
BASE = omni_kinematics.Base.symmetric(la.L, (np.pi / 3, np.pi, 5 * np.pi / 3), la.E, la.R)
GEOMETRY = Geometry(ca.DM(BASE.x), ca.DM(BASE.y), ca.DM([la.E] * 3), ca.DM([la.R] * 3))
MASSES = Masses(
    la.M_P, la.M_P * la.X_G, 0.0, la.I_P + la.M_P * la.X_G**2, la.M_W, la.D, la.I_S, la.I_PHI
)

LAGRANGE = la.equations()
# test point of the reference numbers
THETA, BETA, RATES = 0.3, np.array([0.2, 1.1, -2.0]), np.array([0.5, -0.2, 0.4])


@lru_cache(maxsize=None)
def oracle(fidelity: str) -> Oracle:
    return oracle_of(f"omni_base/{fidelity}")


def vector(name: str, values: np.ndarray) -> dict[str, float]:
    return {f"{name}[{k + 1}]": float(value) for k, value in enumerate(values)}


def point(theta: float, beta: np.ndarray, rates: np.ndarray) -> dict[str, float]:
    motion = dict(zip(("vel_x", "vel_y", "yaw_rate"), map(float, rates), strict=True))
    return {"pose_theta": theta, **vector("steering_angle", beta), **motion}


def read(values: dict[str, float], name: str) -> np.ndarray:
    return np.array([values[f"{name}[{k}]"] for k in (1, 2, 3)])


def random_states(count: int, seed: int = 0) -> list[tuple[float, np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(seed)
    return [
        (float(rng.uniform(-4, 4)), rng.uniform(-4, 4, 3), rng.normal(size=3)) for _ in range(count)
    ]


def full(theta: float, beta: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """X and X' that obey the constraints."""
    beta_rate, phi_rate = omni_kinematics.inverse(BASE, theta, beta, rates)
    return (
        np.concatenate([[0.1, -0.2, theta], beta, np.zeros(3)]),
        np.concatenate([rates, beta_rate, phi_rate]),
    )


def s_matrix(theta: float, beta: np.ndarray) -> np.ndarray:
    return np.vstack(
        [np.eye(3), omni_kinematics.joint_map(BASE, beta) @ omni_kinematics.rotation(theta)]
    )


def reduced_at(theta: float, beta: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """M and h in world axes, from the equations of the component."""
    r = np.asarray(rotation(ca.DM(theta)))
    u = r @ rates
    beta_rate, _ = omni_kinematics.inverse(BASE, theta, beta, rates)
    mass, bias = reduced(GEOMETRY, MASSES, ca.DM(beta), ca.DM(u), ca.DM(beta_rate))
    return r.T @ np.asarray(mass) @ r, r.T @ np.asarray(bias).ravel()


def test_contact_points_do_not_slip_and_a_s_vanishes() -> None:
    for theta, beta, rates in random_states(50):
        q, v = full(theta, beta, rates)
        # speeds of order 10 m/s at rounding
        assert np.abs(np.asarray(LAGRANGE.slip(q, v))).max() < 1e-13
        assert np.abs(np.asarray(LAGRANGE.constraint(q, v)) @ s_matrix(theta, beta)).max() < 1e-13
        y = oracle("dynamic").outputs(point(theta, beta, rates))
        np.testing.assert_allclose(read(y, "betad"), v[3:6], rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(read(y, "phid"), v[6:9], rtol=1e-12, atol=1e-12)


def test_the_third_column_printed_in_eq_14_would_slip() -> None:
    _, c1 = omni_kinematics.constraint_rows(BASE, BETA)
    printed = c1.copy()
    printed[:, 2] = la.E - np.array(BASE.x) * np.sin(BETA) - np.array(BASE.y) * np.cos(BETA)
    r = omni_kinematics.rotation(THETA)
    q = np.concatenate([[0, 0, THETA], BETA, np.zeros(3)])
    for rows, holds in ((c1, True), (printed, False)):
        v = np.concatenate([RATES, -rows @ r @ RATES / la.E, np.zeros(3)])
        assert (np.abs(np.asarray(LAGRANGE.slip(q, v))[:3]).max() < 1e-14) == holds


def test_inertia_and_velocity_forces_are_those_of_lagrange() -> None:
    for theta, beta, rates in random_states(20, 1):
        q, v = full(theta, beta, rates)
        v[3:6] += rates  # also off the constraints
        t = np.asarray(LAGRANGE.inertia(q, v))
        r = np.asarray(rotation(ca.DM(theta)))
        f, g = (np.asarray(item) for item in inertia_blocks(GEOMETRY, MASSES, ca.DM(beta)))
        block = np.zeros((9, 9))
        block[:3, :3], block[:3, 3:6], block[3:6, :3] = r.T @ f @ r, r.T @ g, g.T @ r
        block[3:6, 3:6], block[6:, 6:] = MASSES.i_beta * np.eye(3), la.I_PHI * np.eye(3)
        np.testing.assert_allclose(t, block, atol=1e-12)  # rounding of 250 kg
        h = np.asarray(LAGRANGE.christoffel(q, v)) @ v
        pose, steering = velocity_forces(GEOMETRY, MASSES, ca.DM(beta), ca.DM(v[2]), ca.DM(v[3:6]))
        np.testing.assert_allclose(h[:3], r.T @ np.asarray(pose).ravel(), atol=1e-10)
        np.testing.assert_allclose(h[3:6], np.asarray(steering).ravel(), atol=1e-10)
        np.testing.assert_array_equal(h[6:], 0.0)


@pytest.mark.slow
def test_mass_matrix_is_positive_definite_and_well_conditioned() -> None:
    eigenvalues = np.array([np.linalg.eigvalsh(reduced_at(*s)[0]) for s in random_states(1500, 2)])
    assert eigenvalues.min() > 20.0
    assert (eigenvalues[:, -1] / eigenvalues[:, 0]).max() < 13.0


def test_velocity_terms_do_no_work() -> None:
    theta, beta, rates = ca.SX.sym("theta"), ca.SX.sym("beta", 3), ca.SX.sym("rates", 3)
    r = rotation(theta)
    s = ca.vertcat(ca.SX.eye(3), ca.vertcat(*joint_map(GEOMETRY, beta)) @ r)
    x_rate = s @ rates
    x = ca.vertcat(0, 0, theta, beta, 0, 0, 0)
    position, velocity = ca.vertcat(theta, beta), ca.vertcat(rates[2], x_rate[3:6])

    def rate(matrix: ca.SX) -> ca.SX:
        return ca.reshape(ca.jtimes(ca.vec(matrix), position, velocity), *matrix.shape)

    mass, bias = reduced(GEOMETRY, MASSES, beta, r @ rates, x_rate[3:6])
    mass = r.T @ mass @ r
    t, c = LAGRANGE.inertia(x, x_rate), LAGRANGE.christoffel(x, x_rate)
    skew_t = rate(t) - 2 * c
    skew_m = rate(mass) - 2 * s.T @ (t @ rate(s) + c @ s)
    power = ca.dot(rates, rate(mass) @ rates) / 2 - ca.dot(rates, r.T @ bias)
    scale = ca.norm_fro(rate(mass))
    check = ca.Function("f", [theta, beta, rates], [skew_t, skew_m, power, scale])
    for state in random_states(200, 3):
        full_form, reduced_form, left, size = (np.asarray(v) for v in check(*state))
        # sums of some hundred terms at rounding
        assert np.abs(full_form + full_form.T).max() < 1e-12 * max(1.0, float(size.item()))
        assert np.abs(reduced_form + reduced_form.T).max() < 1e-12 * max(1.0, float(size.item()))
        assert abs(left.item()) < 1e-12 * max(1.0, float(size.item())) * max(
            1.0, np.abs(state[2]).max() ** 2
        )


def test_reduced_form_equals_the_form_with_multipliers() -> None:
    rng = np.random.default_rng(4)
    for theta, beta, rates in random_states(30, 5):
        q, v = full(theta, beta, rates)
        motor = rng.normal(size=6) * 5
        t, a = np.asarray(LAGRANGE.inertia(q, v)), np.asarray(LAGRANGE.constraint(q, v))
        h = np.asarray(LAGRANGE.christoffel(q, v)) @ v
        right = np.concatenate(
            [
                np.concatenate([np.zeros(3), motor]) - h,
                -np.asarray(LAGRANGE.constraint_rate(q, v)) @ v,
            ]
        )
        solution = np.linalg.solve(np.block([[t, -a.T], [a, np.zeros((6, 6))]]), right)
        inputs = {**vector("tau_beta", motor[:3]), **vector("tau_phi", motor[3:])}
        d = oracle("dynamic").derivatives({**point(theta, beta, rates), **inputs, **FREE})
        got = [d["vel_x"], d["vel_y"], d["yaw_rate"]]
        # condition of the large system is about 1e5
        np.testing.assert_allclose(got, solution[:3], rtol=1e-10, atol=1e-10)


def test_reference_numbers_at_the_test_point() -> None:
    mass, bias = reduced_at(THETA, BETA, RATES)
    # an independent program printed these numbers to eight decimals
    np.testing.assert_allclose(
        mass,
        [
            [249.03386154, 3.26675054, -2.42472378],
            [3.26675054, 255.27863846, 3.51796446],
            [-2.42472378, 3.51796446, 21.91787634],
        ],
        atol=1e-8,
    )
    np.testing.assert_allclose(bias, [19.44404175, 7.64363821, -28.60613229], atol=1e-8)
    y = oracle("dynamic").outputs(point(THETA, BETA, RATES))
    np.testing.assert_allclose(read(y, "betad"), [-4.43171556, -7.77777188, 7.13396849], atol=1e-8)
    np.testing.assert_allclose(read(y, "phid"), [-2.37986269, 2.36875405, -0.19804773], atol=1e-8)
    wanted = np.array([0.3, 0.1, -0.2])
    np.testing.assert_allclose(
        mass @ wanted + bias, [94.96582002, 33.44793433, -33.36532824], atol=1e-8
    )
    tau_beta, tau_phi = torques(THETA, BETA, RATES, wanted, friction=False)
    np.testing.assert_allclose(tau_beta, [-2.20777911, -0.30605654, 1.80170335], atol=1e-8)
    np.testing.assert_allclose(tau_phi, [-5.60575261, -4.70813948, -1.21542868], atol=1e-8)


def test_axle_friction_at_the_test_point() -> None:
    _, v = full(THETA, BETA, RATES)
    with_friction = oracle("dynamic").derivatives(point(THETA, BETA, RATES))
    without = oracle("dynamic").derivatives({**point(THETA, BETA, RATES), **FREE})
    names = ("vel_x", "vel_y", "yaw_rate")
    change = np.array([without[n] - with_friction[n] for n in names])
    mass, _ = reduced_at(THETA, BETA, RATES)
    axles = 5.0 * np.sign(v[3:]) + 1.5 * v[3:]
    np.testing.assert_allclose(
        axles,
        [-11.64757334, -16.66665782, 15.70095274, -8.56979403, 8.55313107, -5.29707159],
        atol=1e-8,
    )
    # tanh(0.198/0.02) is 1 within 1e-8, times 5 N.m/0.1 m
    np.testing.assert_allclose(mass @ change, [523.57426914, -284.19863059, 40.8392651], atol=1e-6)


@pytest.mark.slow
def test_free_run_keeps_its_energy_and_ends_where_it_should() -> None:
    run = oracle("dynamic").simulate([0.0, 5.0, 10.0], {**point(THETA, BETA, RATES), **FREE})
    energy = run["E_stored"]
    assert energy[0] == pytest.approx(36.895178602, abs=1e-9)
    # integrator tolerance 1e-11 over 10 s
    assert np.abs(energy / energy[0] - 1).max() < 1e-9
    got = [run[n][-1] for n in ("x", "y", "theta", "beta[1]", "beta[2]", "beta[3]")]
    np.testing.assert_allclose(
        got,
        [4.65256344, -1.85894356, 6.56663807, -6.88954965, -7.21768481, -6.61428882],
        atol=2e-8,
    )
    got = [run[n][-1] for n in ("xd", "yd", "thetad")]
    np.testing.assert_allclose(got, [0.47437219, -0.17743936, 0.6348308], atol=2e-8)


@pytest.mark.slow
def test_work_of_the_motors_is_the_gain_of_energy() -> None:
    motor = {**vector("tau_beta", np.array([0.5, -0.3, 0.2]))}
    motor |= vector("tau_phi", np.array([-2.0, -1.5, -1.0]))
    run = oracle("dynamic").simulate([0.0, 2.0], {**point(THETA, BETA, RATES), **motor, **FREE})
    got = [run[n][-1] for n in ("x", "y", "theta", "xd", "yd", "thetad")]
    np.testing.assert_allclose(
        got, [1.26839035, -0.4762851, 1.41060631, 0.8013881, -0.28119505, 0.61598665], atol=2e-8
    )
    work = sum(
        motor[f"{torque}[{k}]"] * (run[f"{angle}[{k}]"][-1] - run[f"{angle}[{k}]"][0])
        for torque, angle in (("tau_beta", "beta"), ("tau_phi", "phi"))
        for k in (1, 2, 3)
    )
    gain = run["E_stored"][-1] - run["E_stored"][0]
    assert gain == pytest.approx(58.508314760, abs=1e-7)
    assert gain == pytest.approx(work, rel=1e-9)  # integrator tolerance


def test_inverse_dynamics_is_undone_by_the_base() -> None:
    rng = np.random.default_rng(6)
    for theta, beta, rates in random_states(10, 7):
        wanted = rng.normal(size=3)
        tau_beta, tau_phi = torques(theta, beta, rates, wanted)
        motor = {**vector("tau_beta", tau_beta), **vector("tau_phi", tau_phi)}
        d = oracle("dynamic").derivatives({**point(theta, beta, rates), **motor})
        np.testing.assert_allclose([d["vel_x"], d["vel_y"], d["yaw_rate"]], wanted, atol=1e-10)
        # minimum norm: nothing of the torques without friction lies in the axles' internal fight
        least = np.concatenate(torques(theta, beta, rates, wanted, friction=False))
        joint = omni_kinematics.joint_map(BASE, beta)
        inside = joint @ np.linalg.lstsq(joint, least, rcond=None)[0]
        np.testing.assert_allclose(inside, least, atol=1e-10)


def test_kinematic_inertia_is_the_mean_over_the_steering_angles() -> None:
    mass, yaw = (float(v) for v in mean_inertia(GEOMETRY, MASSES))
    grid = np.linspace(0, 2 * np.pi, 12, endpoint=False)  # exact for harmonics up to order 11
    # each wheel enters M alone: turning all three together gives the mean of each
    diagonals = [np.diag(reduced_at(0.0, np.full(3, b), np.zeros(3))[0]) for b in grid]
    np.testing.assert_allclose(np.mean(diagonals, axis=0), [mass, mass, yaw], rtol=1e-12)


@pytest.mark.slow
def test_slipping_wheels_approach_rolling_ones() -> None:
    motor = {**vector("tau_beta", np.array([0.5, -0.3, 0.2]))}
    motor |= vector("tau_phi", np.array([-2.0, -1.5, -1.0]))
    _, v = full(THETA, BETA, RATES)
    joint = {**vector("steering_rate", v[3:6]), **vector("rolling_rate", v[6:9])}
    start = {**point(THETA, BETA, RATES), **motor, **FREE}
    times = [0.0, 0.25, 0.5]
    rolling = oracle("dynamic").simulate(times, start)
    errors = []
    for v_c in (2e-3, 1e-3):
        run = oracle("slip").simulate(times, {**start, **joint, "v_c": v_c}, rtol=1e-8, atol=1e-10)
        errors.append(np.hypot(run["x"][-1] - rolling["x"][-1], run["y"][-1] - rolling["y"][-1]))
    # creep F v_c/(1.5 mu N): at most v_c/1.5 for 0.5 s, and proportional to v_c
    assert errors[0] < 2e-3 / 1.5 * 0.5
    assert errors[1] == pytest.approx(errors[0] / 2, rel=0.05)


def test_forward_kinematics_recovers_the_motion_and_shows_slip() -> None:
    for theta, beta, rates in random_states(20, 8):
        beta_rate, phi_rate = omni_kinematics.inverse(BASE, theta, beta, rates)
        got, misfit = omni_kinematics.forward(BASE, theta, beta, beta_rate, phi_rate)
        np.testing.assert_allclose(got, rates, atol=1e-12)
        assert misfit < 1e-12
        _, misfit = omni_kinematics.forward(
            BASE, theta, beta, beta_rate, phi_rate + np.array([0.5, 0, 0])
        )
        assert misfit > 0.01


def test_singular_configurations() -> None:
    def least(beta: np.ndarray, steering: tuple[int, ...], rolling: tuple[int, ...]) -> float:
        return omni_kinematics.least_singular_value(BASE, beta, steering, rolling)

    every, draws = (0, 1, 2), [beta for _, beta, _ in random_states(3000, 9)]
    assert min(least(b, every, every) for b in draws) > 5.5
    for pair in ((0, 1), (0, 2), (1, 2)):  # any two wheels with both motors suffice
        assert min(least(b, pair, pair) for b in draws) > 3.7
    parallel = np.full(
        3, 0.7
    )  # equal angles: one kind of motor alone does not determine the motion
    assert least(parallel, (), every) < 1e-12 and least(parallel, every, ()) < 1e-12
    assert least(np.array([0.2, 1.1, -2.0]), (), every) > 0.1
