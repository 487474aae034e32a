"""Losses and resonance of the gearboxes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from sources.function import Oracle
from tests.drives.closed_drive import ClosedDrive
from tests.support import oracle_of

RATIO, ETA = 10.167, 0.9


def random_loads(count: int) -> list[tuple[float, float]]:
    rng = np.random.default_rng(4)
    return [(float(a), float(b)) for a, b in rng.normal(size=(count, 2)) * (1.0, 10.0)]


def loss(oracle: Oracle, tau_a: float, w_b: float) -> float:
    point = {"tau_a": tau_a, "w_b": w_b}
    if "rotor_speed" in oracle.state_names:
        point["rotor_speed"] = RATIO * w_b
    return oracle.outputs(point)["P_loss"]


@pytest.mark.parametrize("fidelity", ["lossy", "elastic"])
def test_a_lossy_gear_never_creates_energy(fidelity: str) -> None:
    oracle = oracle_of(f"gearbox/{fidelity}")
    losses = [loss(oracle, *load) for load in random_loads(500)]
    assert min(losses) >= 0.0
    assert max(losses) > 1.0


def test_a_constant_efficiency_does_create_energy() -> None:
    """The negative twin: the papers' gain gives power while the load drives."""
    oracle = oracle_of("gearbox/ratio")
    assert loss(oracle, 1.0, 5.0) == pytest.approx((1 - ETA) * RATIO * 5.0, rel=1e-12)
    assert loss(oracle, -1.0, 5.0) == pytest.approx(-(1 - ETA) * RATIO * 5.0, rel=1e-12)


def test_lossy_gear_is_the_gain_while_driving_and_its_inverse_while_braking() -> None:
    oracle = oracle_of("gearbox/lossy")
    # 50 W against a blend of 0.5 W: tanh(100) is 1 to rounding
    driving = oracle.outputs({"tau_a": 1.0, "w_b": 50 / RATIO})["tau_b"]
    braking = oracle.outputs({"tau_a": -1.0, "w_b": 50 / RATIO})["tau_b"]
    assert driving == pytest.approx(RATIO * ETA, rel=1e-12)
    assert braking == pytest.approx(-RATIO / ETA, rel=1e-12)


@pytest.mark.parametrize("inertia", [0.02, 0.1, 0.6])
def test_two_masses_resonate_where_theory_says(inertia: float) -> None:
    """A free two-mass drive: lambda^2 + d c lambda + k c = 0 with c = 1/J + 1/(ratio^2 J_a)."""
    stiffness, damping, rotor = 6000.0, 1.1, 2e-4
    free = {"load.J": inertia, "load.b": 0.0, "motor.k_w": 1e-9, "motor.b_m": 0.0}
    drive = ClosedDrive("dc_motor/ideal", "inertia/disc", "gearbox/elastic", values=free)
    a, *_ = drive.matrices()
    index = [drive.states.index(n) for n in ("gear.twist", "gear.rotor_speed", "load.speed")]
    poles = np.linalg.eigvals(a[np.ix_(index, index)])
    pole = poles[np.argmax(poles.imag)]
    compliance = 1 / inertia + 1 / (RATIO**2 * rotor)
    # what is left of the motor is a servo of 1e-9 N.m.s/rad, 1e-5 of the spring's damping
    assert abs(pole) == pytest.approx(np.sqrt(stiffness * compliance), rel=1e-6)
    assert -2 * pole.real == pytest.approx(damping * compliance, rel=1e-4)


@pytest.mark.parametrize(("order", "share"), [("Jacobi", 1.0), ("Gauss-Seidel", 0.0)])
def test_damping_lost_by_the_exchange_with_the_load(order: str, share: float) -> None:
    """Held speeds cost damping k H (1/J) / (1/J + 1/(ratio^2 J_a)) with Jacobi, none otherwise."""
    stiffness, damping, inertia, step = 6000.0, 1.1, 0.1, 1e-4
    oracle = oracle_of("gearbox/elastic")
    rest = {"tau_a": 0.0, "w_b": 0.0}
    columns = [oracle.derivatives({**rest, name: 1e-6}) for name in (*oracle.state_names, "w_b")]
    a = np.array([[c[name] * 1e6 for c in columns] for name in oracle.state_names])
    exact = expm(np.vstack([a, np.zeros((1, 3))]) * step)  # gearbox with the load's speed held
    torque = np.array([stiffness, damping / RATIO, -damping])
    after = exact @ np.eye(3)
    exchanged = torque if order == "Jacobi" else torque @ after
    after[2] += step / inertia * exchanged
    pole = np.log(np.linalg.eigvals(after).astype(complex)) / step
    pole = pole[np.argmax(pole.imag)]
    compliance = 1 / inertia + 1 / (RATIO**2 * 2e-4)
    lost = damping + 2 * pole.real / compliance
    expected = share * stiffness * step / inertia / compliance
    # terms of higher order in H: (omega H)^2 = 0.4 % of k H
    assert lost == pytest.approx(expected, abs=0.004 * stiffness * step)


@pytest.mark.parametrize(("signed", "rigid"), [(1.0, "lossy"), (0.0, "ratio")])
def test_stiff_spring_gives_the_rigid_gear(signed: float, rigid: str) -> None:
    """Acceleration of motor and load under a torque, once the stiff spring has settled."""
    stiff = {"gear.k": 1e9, "gear.d": 1e5, "gear.signed": signed}
    speed, current = 20.0, 5.0
    drives = {
        "elastic": ClosedDrive("dc_motor/electrical", "inertia/disc", "gearbox/elastic", stiff),
        rigid: ClosedDrive("dc_motor/electrical", "inertia/disc", f"gearbox/{rigid}"),
    }
    for sign in (1, -1):
        rates = {}
        for name, drive in drives.items():
            x = drive.start
            x[drive.states.index("load.speed")] = speed
            x[drive.states.index("motor.current")] = sign * current
            if name == "elastic":
                x[drive.states.index("gear.rotor_speed")] = RATIO * speed
                index = [drive.states.index(n) for n in ("gear.twist", "load.speed")]
                index.insert(1, drive.states.index("gear.rotor_speed"))
                # twist at which rotor and load accelerate alike
                for _ in range(3):
                    rate = np.asarray(drive.rate(x, [], 0.0)).ravel()[index]
                    a = np.array(drive.linear(x, [], 0.0)[0])[np.ix_(index, index)]
                    gap = rate[1] / RATIO - rate[2]
                    x[index[0]] -= gap / (a[1, 0] / RATIO - a[2, 0])
            rates[name] = np.asarray(drive.rate(x, [], 0.0)).ravel()[
                drive.states.index("load.speed")
            ]
        # rounding of a torque that is a difference of 1e9 N.m/rad times a twist of 1e-8 rad
        assert rates["elastic"] == pytest.approx(rates[rigid], rel=1e-6)


def test_rotor_inertia_is_counted_once() -> None:
    assert oracle_of("gearbox/ratio").outputs()["J_b"] == pytest.approx(RATIO**2 * 2e-4)
    assert oracle_of("gearbox/elastic").outputs()["J_b"] == 0.0


def test_rotor_without_inertia_does_not_divide_by_zero() -> None:
    oracle = oracle_of("gearbox/elastic")
    assert np.isfinite(oracle.derivatives({"J_a": 0.0, "tau_a": 1.0})["rotor_speed"])
