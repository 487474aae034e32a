"""Casters: alignment, energy, momentum of the swinging fork."""

from __future__ import annotations

import numpy as np
import pytest

from tests.base.stiff import Stiff
from tests.support import oracle_of

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("fidelity", ["swivel", "creep"])
@pytest.mark.parametrize("start", [2.9, -1.5, 0.4])
def test_caster_trails_behind_the_motion(fidelity: str, start: float) -> None:
    caster = Stiff(f"caster/{fidelity}", {"v_x": 0.5, "swivel_angle": start, "spin": 0.0})
    y = caster.run(3.0)
    assert abs(y["psi"][-1]) < 1e-3  # aligns with the length of the trail: exp(-0.5*3/0.038)
    assert abs(y["psi"]).max() <= abs(start) * (1 + 1e-6)  # it does not swing away first
    assert y["w"][-1] == pytest.approx(0.5 / 0.0625, rel=1e-3)  # rolls but for bearing drag


def test_slow_alignment_follows_the_rolling_geometry() -> None:
    """Without inertia and damping the wheel rolls along its heading: trail psi' = -v sin psi."""
    values = {
        "v_x": 0.05,
        "swivel_angle": 1.0,
        "b_s": 0.0,
        "b_w": 0.0,
        "spin": 0.05 * np.cos(1) / 0.0625,
    }
    caster = Stiff("caster/creep", {**values, "c_h": 1e-8, "c_n": 1e-8})
    y = caster.run(1.0)
    psi = 2 * np.arctan(np.tan(0.5) * np.exp(-0.05 * y["time"] / 0.0382))
    # inertia delays by about J v/(trail^2 N) and creep adds its own slip, both below 1e-3
    assert np.abs(y["psi"] - psi).max() < 2e-3


def test_caster_that_is_pushed_backwards_turns_over() -> None:
    caster = Stiff("caster/swivel", {"v_x": -0.3, "swivel_angle": 0.02})
    y = caster.run(4.0)
    assert y["psi"][-1] == pytest.approx(np.pi, abs=1e-3)  # aligned again, exp(-0.3*3/0.038)


def test_coulomb_friction_of_the_swivel_holds_it_askew() -> None:
    """The swivel stops where the side force of the trail no longer beats its dry friction."""
    values = {"v_x": 0.05, "swivel_angle": 0.8, "coulomb.w_0": 1e-3}
    free = Stiff("caster/swivel+coulomb", {**values, "coulomb.tau_c": 0.0}).run(2.0)
    held = Stiff("caster/swivel+coulomb", {**values, "coulomb.tau_c": 10.0}).run(2.0)
    # 10 N.m exceed mu N trail = 5.3 N.m: the fork turns only by the creep of the smoothed sign
    assert abs(free["psi"][-1]) < 0.1
    assert held["psi"][-1] == pytest.approx(0.8, abs=5e-3)


def test_base_and_frictionless_casters_keep_their_momentum() -> None:
    """Bodies in a plane without outer forces: momentum, angular momentum and energy stay.

    The mass centres of forks and wheels are placed here by geometry, independently of the way in
    which the model eliminates the pivots' accelerations.
    """
    free = {"drive_wheel.mu": 0.0, "caster.mu": 0.0, "caster.b_s": 0.0, "caster.b_w": 0.0}
    free |= {"caster.c_rr": 0.0, "drive_wheel.c_rr": 0.0, "com_x": 0.07, "com_y": -0.04}
    heavy = {"caster.m_f": 4.0, "caster.m_w": 6.0}  # swing that cannot be overlooked
    start = {"vel_x": 0.4, "vel_y": -0.2, "yaw_rate": 0.9}
    angles = {"caster_fl": 0.3, "caster_fr": 2.1, "caster_rl": -1.0, "caster_rr": 3.0}
    start |= {f"{name}.swivel_angle": angle for name, angle in angles.items()}
    start |= {"caster_fl.momentum": 0.4, "caster_rr.momentum": -0.3}
    base = Stiff("mobile_base.lab/planar[wheel_contact=creep,caster=creep]", free | heavy | start)
    p = {
        v.name: float(x)
        for v, x in zip(base.oracle.model.of_role("parameter"), base.p, strict=True)
    }

    def momenta() -> np.ndarray:
        x, y, phi = (base.state(name) for name in ("pose_x", "pose_y", "pose_phi"))
        v = np.array([base.state("vel_x"), base.state("vel_y")])
        w = base.state("yaw_rate")
        turn = np.array([[np.cos(phi), -np.sin(phi)], [np.sin(phi), np.cos(phi)]])

        def cross(a: np.ndarray, b: np.ndarray) -> float:
            return float(a[0] * b[1] - a[1] * b[0])

        def spin(rate: float, arm: np.ndarray) -> np.ndarray:
            return rate * np.array([-arm[1], arm[0]])

        linear, angular = np.zeros(2), 0.0
        origin = np.array([x, y])

        def add(
            mass: float, place: np.ndarray, velocity: np.ndarray, inertia: float, rate: float
        ) -> None:
            nonlocal linear, angular
            world, moving = origin + turn @ place, turn @ velocity
            linear = linear + mass * moving
            angular += mass * cross(world, moving) + inertia * rate

        com = np.array([p["com_x"], p["com_y"]])
        add(p["mass"], com, v + spin(w, com), p["I_zz"], w)
        add(p["cabinet_mass"], np.zeros(2), v, p["cabinet_I_zz"], w)
        for side in (1, -1):
            place = np.array([0.0, side * p["track"] / 2])
            add(p["drive_mass"], place, v + spin(w, place), p["drive_inertia"], w)
        trail, m_w, m_f = p["caster.trail"], p["caster.m_w"], p["caster.m_f"]
        for name, sx, sy in (("fl", 1, 1), ("fr", 1, -1), ("rl", -1, 1), ("rr", -1, -1)):
            pivot = np.array([sx * p["caster_x"], sy * p["caster_y"]])
            psi = base.state(f"caster_{name}.swivel_angle")
            h, n = np.array([np.cos(psi), np.sin(psi)]), np.array([-np.sin(psi), np.cos(psi)])
            at_pivot = v + spin(w, pivot)
            behind = m_w * trail + m_f * p["caster.x_f"] * trail
            inertia = (
                p["caster.J_t"]
                + p["caster.J_f"]
                + m_w * trail**2
                + m_f * (p["caster.x_f"] * trail) ** 2
            )
            rate = (base.state(f"caster_{name}.momentum") + behind * at_pivot @ n) / inertia
            for mass, length, own in (
                (m_w, trail, p["caster.J_t"]),
                (m_f, p["caster.x_f"] * trail, p["caster.J_f"]),
            ):
                add(mass, pivot - length * h, at_pivot - rate * length * n, own, rate)
        return np.array([*linear, angular])

    before, energy = momenta(), base.outputs()["E_stored"]
    base.run(1.0, h=5e-4)
    # third order of the integrator at forks that turn by some 10 rad/s
    assert momenta() == pytest.approx(before, rel=1e-5)
    assert base.outputs()["E_stored"] == pytest.approx(energy, rel=1e-5)


def test_energy_lost_is_energy_missing() -> None:
    """A caster dragged along: work of the pivot = stored + lost, over a whole run."""
    caster = Stiff("caster/swivel", {"v_x": 0.5, "swivel_angle": 2.0})
    y = caster.run(0.4, h=2e-4)
    balance = np.trapezoid(y["P_in"] - y["P_loss"], y["time"])
    gained = y["E_stored"][-1] - y["E_stored"][0]
    largest = np.trapezoid(np.abs(y["P_loss"]), y["time"])
    assert balance == pytest.approx(gained, abs=2e-3 * largest)  # trapezoid over the first jerk


def test_scrub_torque_acts_on_the_fork_not_on_the_body() -> None:
    caster = oracle_of("caster/swivel+pivot_torque")
    values = {"w_z": 0.4, "momentum": 0.003, "v_x": 0.0}
    off = caster.derivatives({**values, "pivot_torque.M_pa": 0.0})
    on = caster.derivatives({**values, "pivot_torque.M_pa": 2.0})
    # the fork turns at 2 rad/s on the spot: nearly saturated, K w/v_0 = 400 N.m
    assert on["momentum"] - off["momentum"] == pytest.approx(-2.0, rel=1e-3)
    still = [caster.outputs({**values, "pivot_torque.M_pa": value})["m_z"] for value in (0.0, 2.0)]
    assert still[0] == still[1]
