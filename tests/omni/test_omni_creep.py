"""The rig omni_bench tick by tick: drives before a base on creeping wheels."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from tests.omni import lagrange as la
from tests.support import Stepper, oracle_of

TICK, SUBSTEPS = 1e-3, 20  # the rig's mechanics advance in steps of 50 us
J_D, J_S = 20**2 * 2e-4, 40**2 * 6e-5
MU, C_X, C_Y, F_R, B_D, B_S = 0.6, 12.0, 9.0, 0.012, 0.6, 0.8
AXES = np.array(la.AXES)


def named(**vectors: Iterable[float] | float) -> dict[str, float]:
    return {
        key if np.ndim(value) == 0 else f"{key}[{i + 1}]": float(item)
        for key, value in vectors.items()
        for i, item in enumerate(np.atleast_1d(value))
    }


def vector(values: dict[str, float], name: str) -> np.ndarray:
    return np.array([values[f"{name}[{k}]"] for k in (1, 2, 3)])


def loads(beta: np.ndarray) -> np.ndarray:
    """Equilibrium of forces and moments, with the masses one by one."""
    t = np.stack([np.cos(beta), np.sin(beta)], axis=1)
    centres, contacts = AXES - la.D * t, AXES - la.E * t
    weights = 9.81 * np.array([la.M_P, *[la.M_W] * 3])
    places = np.vstack([[la.X_G, 0.0], centres])
    matrix = np.vstack([np.ones(3), contacts.T])
    return np.linalg.solve(matrix, np.append(weights.sum(), weights @ places))


def test_loads_are_those_of_statics() -> None:
    base = oracle_of("omni_base/creep")
    rng = np.random.default_rng(0)
    for _ in range(20):
        beta, theta = rng.uniform(-4, 4, 3), float(rng.uniform(-4, 4))
        seen = base.outputs(named(steering_angle=beta, pose_theta=theta))
        # rounding of 2500 N
        np.testing.assert_allclose(vector(seen, "normal"), loads(beta), rtol=1e-12)


def test_a_payload_presses_on_the_wheels_that_it_is_near() -> None:
    base = oracle_of("omni_base/creep+payload")
    place = AXES[0] - la.E * np.array([1.0, 0.0])  # above the contact of the first wheel
    at = named(**{"payload.position": [*place, 0.3]})
    bare = vector(base.outputs({**at, "payload.mass": 0.0}), "normal")
    full = vector(base.outputs({**at, "payload.mass": 30.0}), "normal")
    np.testing.assert_allclose(full - bare, [30 * 9.81, 0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize("shift", [0.1, 0.25])
def test_a_wheel_that_is_lifted_is_not_driven_by_the_floor(shift: float) -> None:
    base = oracle_of("omni_base/creep+load_shift")
    at = named(rolling_rate=[-5.0] * 3, vel_x=0.5)
    seen = base.outputs({**at, "load_shift.shift": shift, "load_shift.direction": 0.0})
    normal = vector(seen, "normal")
    assert normal.min() == 0.0 < normal.max()
    free = {**at, "load_shift.shift": shift, "load_shift.direction": 0.0, "f_r": 0.0}
    rolling = seen["P_loss"] - base.outputs(free)["P_loss"]
    # tanh(5 / 0.1) is 1
    radius = base.outputs(at)["P_loss"] - base.outputs({**at, "f_r": 0.0})["P_loss"]
    whole = vector(base.outputs(at), "normal").sum()
    assert rolling == pytest.approx(radius * normal.sum() / whole, rel=1e-9)


class Sheet:
    """The rig's sentences written out with Lagrange's equations; p' is positive forward."""

    def __init__(self, beta: np.ndarray) -> None:
        self.equations = la.equations()
        self.q, self.v = np.zeros(9), np.zeros(9)
        self.q[3:6] = beta
        self.i_d, self.i_s, self.integral = np.zeros(3), np.zeros(3), np.zeros(3)

    def acceleration(self, i_d: np.ndarray, i_s: np.ndarray) -> np.ndarray:
        q, v = self.q, self.v
        t = np.asarray(self.equations.inertia(q, v)) + np.diag([0.0] * 3 + [J_S] * 3 + [J_D] * 3)
        force = -np.asarray(self.equations.christoffel(q, v)) @ v
        roll, n = -v[6:], loads(q[3:6])
        slip = np.asarray(self.equations.slip(q, v)).ravel()
        s_n, s_t = slip[:3], slip[3:]
        speed = np.hypot(la.R * roll, 0.05)
        p_t, p_n = C_X * n * s_t / speed, C_Y * n * s_n / speed
        f = np.hypot(p_t, p_n) + 1e-12
        g = MU * n * np.tanh(f / (MU * n)) / f
        contact = np.concatenate([-g * p_n, -g * p_t])
        force += np.asarray(self.equations.constraint(q, v)).T @ contact
        force[3:6] += 40 * 0.78 * 0.06 * i_s - B_S * v[3:6]
        resistance = F_R * n * la.R * np.tanh(roll / 0.1)
        force[6:] -= 20 * 0.8 * 0.10 * i_d - B_D * roll - resistance
        return np.linalg.solve(t, force)

    def tick(self, twist: np.ndarray) -> None:
        beta, roll = self.q[3:6], -self.v[6:]
        x, y = AXES.T
        v_x, v_y = twist[0] - twist[2] * y, twist[1] + twist[2] * x
        error = (np.cos(beta) * v_x + np.sin(beta) * v_y) / 0.1 - roll
        wanted = 6 * error + self.integral
        set_d = np.clip(wanted, -25, 25)
        self.integral += np.where(np.abs(wanted) < 25, 30 * error * TICK, 0)
        across = np.cos(beta) * v_y - np.sin(beta) * v_x
        set_s = np.clip(14 * (across / 0.08 - twist[2] - self.v[3:6]), -15, 15)
        h = TICK / SUBSTEPS
        for k in range(SUBSTEPS):
            decay = np.exp(-(k + 0.5) * h / 1.5e-3)
            i_d, i_s = set_d + (self.i_d - set_d) * decay, set_s + (self.i_s - set_s) * decay
            self.v = self.v + h * self.acceleration(i_d, i_s)
            self.q = self.q + h * self.v
        decay = np.exp(-TICK / 1.5e-3)
        self.i_d = set_d + (self.i_d - set_d) * decay
        self.i_s = set_s + (self.i_s - set_s) * decay


@pytest.mark.slow
def test_rig_is_repeated_tick_by_tick() -> None:
    beta = np.array([0.4, -0.2, 0.3])
    rig = Sheet(beta)
    drive = Stepper("twist_drive/sampled")
    # RK4 with the rig's step: contact time constants near standstill are 50 us
    start = named(steering_angle=beta, I_phi=la.I_PHI + J_D)
    base = Stepper("omni_base/creep", start, max_step=5e-5)
    seen = base.outputs()
    for k in range(200):
        twist = np.array([1.2, 0.5, 0.8]) * k * TICK
        rig.tick(twist)
        inputs = named(
            vx_set=twist[0], vy_set=twist[1], w_set=twist[2],
            **{name: vector(seen, name) for name in ("beta", "phi", "betad", "phid")},
        )  # fmt: skip
        given = drive.step(inputs, TICK)
        seen = base.step({name: given[name] for name in given if name.startswith("tau_")}, TICK)
    # The rig's Euler steps err by h/2 = 25 us times rates (0.5 rad/s of the forks, 0.15 m/s) and
    # accelerations (2 rad/s2); gains of 6 and 14 A.s/rad make currents of it.
    assert abs(seen["x"] - rig.q[0]) < 1e-5 and abs(seen["y"] - rig.q[1]) < 1e-5
    assert abs(seen["theta"] - rig.q[2]) < 1e-5
    np.testing.assert_allclose(vector(seen, "beta"), rig.q[3:6], atol=3e-5)
    np.testing.assert_allclose(vector(seen, "phid"), rig.v[6:], atol=5e-5)
    np.testing.assert_allclose(vector(given, "i_d"), rig.i_d, atol=7e-4)
    np.testing.assert_allclose(vector(given, "i_s"), rig.i_s, atol=7e-4)
    assert rig.q[0] > 0.01 and np.abs(rig.i_d).min() > 0.5  # it did move


@pytest.mark.parametrize(("speed", "left"), [(1.0, 0.0), (0.1, 1.5)])
def test_integral_stands_still_at_the_current_limit(speed: float, left: float) -> None:
    """1 m/s asks a wheel that is held for 60 A; 0.1 m/s for 6 A, and 30 A/s more."""
    drive = Stepper("twist_drive/sampled")
    held = [drive.step({"vx_set": speed}, TICK) for _ in range(50)][-1]
    rest = [drive.step({"vx_set": 0.0}, TICK) for _ in range(50)][-1]
    # 50 ms are 33 time constants; the last tick's 0.03 A of the integral is on its way
    np.testing.assert_allclose(vector(held, "i_d"), min(25.0, 60 * speed + left), atol=0.07)
    np.testing.assert_allclose(vector(rest, "i_d"), left, atol=1e-6)


def test_scrub_of_one_wheel_is_its_share_of_that_of_all() -> None:
    state = named(
        yaw_rate=0.4, vel_x=0.3, steering_angle=[0.3, -0.2, 1.0],
        steering_rate=[0.3, -0.9, 0.2], rolling_rate=[-2.0, -3.0, -1.0],
    )  # fmt: skip
    rates = ["vel_x", "vel_y", "yaw_rate", *(f"steering_rate[{k}]" for k in (1, 2, 3))]

    def change(port: str) -> np.ndarray:
        base = oracle_of(f"omni_base/creep+pivot_torque@{port}")
        some, none = (
            base.derivatives({**state, f"{port}.pivot_torque.M_pa": size}) for size in (6.0, 0.0)
        )
        return np.array([some[name] - none[name] for name in rates])

    single = [change(f"pivot_{k}") for k in (1, 2, 3)]
    # accelerations are linear in torques; differences of terms of 1e3 rad/s2 (creep)
    np.testing.assert_allclose(sum(single), change("pivot"), atol=1e-11)
    for k, moved in enumerate(single):
        spin = state["yaw_rate"] + state[f"steering_rate[{k + 1}]"]
        assert moved[3 + k] * spin < 0.0  # its own fork gives way to the patch's torque


def test_a_motor_that_saturates_loses_its_own_torque_only() -> None:
    s, i_s, place = 0.2, 8.0, "rolling_torque_constant_2"
    law = "torque_constant_saturation"
    plain, weak = (
        Stepper(
            f"twist_drive/sampled+{law}@{place}",
            {f"{place}.{law}.s": size, f"{place}.{law}.i_s": i_s},
        )
        for size in (0.0, s)
    )
    before, after = ([d.step({"vx_set": 0.1}, TICK) for _ in range(50)][-1] for d in (plain, weak))
    np.testing.assert_array_equal(vector(before, "i_d"), vector(after, "i_d"))  # the base is held
    square = after["i_d[2]"] ** 2
    left = vector(after, "tau_phi") / vector(before, "tau_phi")
    # the mean over a period is the current at its end but for 1e-3 of it (the loop's integral)
    np.testing.assert_allclose(left, [1.0, 1.0 - s * square / (square + i_s**2), 1.0], rtol=1e-3)


def test_a_current_loop_believes_its_sensor() -> None:
    g, place = 0.05, "rolling_current_2"
    plain = Stepper("twist_drive/sampled")
    wrong = Stepper(f"twist_drive/sampled+current_gain@{place}", {f"{place}.current_gain.g": g})
    before, after = ([d.step({"vx_set": 0.1}, TICK) for _ in range(50)][-1] for d in (plain, wrong))
    # what it shows is what was asked for, but for 3e-3 of it: the integral rises while it settles
    shown = vector(after, "i_d_measured")
    np.testing.assert_allclose(shown, vector(before, "i_d_measured"), rtol=3e-3)
    np.testing.assert_allclose(vector(after, "i_d"), shown / [1.0, 1.0 + g, 1.0], rtol=1e-12)
    torque = vector(after, "tau_phi") / vector(before, "tau_phi")
    np.testing.assert_allclose(torque, [1.0, 1.0 / (1.0 + g), 1.0], rtol=3e-3)


def test_a_wheel_whose_node_is_late_does_what_it_would_have_done() -> None:
    """Some ticks later, with steering and rolling; the other wheels know nothing of it."""
    late = 7
    plain = Stepper("twist_drive/sampled")
    one = Stepper("twist_drive/sampled+delay@node_3", {"node_3.delay.t_d": late * TICK})
    twists = [{"vx_set": 0.002 * k, "vy_set": 0.001 * k, "w_set": 0.003 * k} for k in range(40)]
    before, after = ([d.step(twist, TICK) for twist in twists] for d in (plain, one))
    for name in ("i_d", "i_s"):
        now, then = (np.array([vector(row, name) for row in rows]) for rows in (before, after))
        np.testing.assert_allclose(then[:, :2], now[:, :2], rtol=1e-14)  # rounding
        # the delay reads between its own samples: rounding of their times
        np.testing.assert_allclose(then[late:, 2], now[:-late, 2], atol=1e-9)
        assert np.all(np.abs(now[5:, 2]) > 1e-3)
