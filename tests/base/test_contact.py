"""Laws of the wheel-floor contact against formulas and known values."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from sources.laws import contact
from tests.base.stiff import Stiff
from tests.support import oracle_of

FIDELITIES = ("rolling", "creep", "stick_slip", "spatial", "brush")


@pytest.mark.parametrize(
    ("ratio", "mu"),
    [
        (0.1, 0.10465),
        (0.25, 0.25703),
        (0.5, 0.48125),
        (1.0, 0.70000),
        (1.5, 0.68788),
        (2.0, 0.65576),
        (3.0, 0.57358),
        (5.0, 0.50366),
        (10.0, 0.50000),
    ],
)
def test_stick_slip_follows_the_tabulated_curve(ratio: float, mu: float) -> None:
    v_c, load = 0.02, 100.0
    wheel = oracle_of("wheel_contact/stick_slip")
    y = wheel.outputs({"v_x": 0.6 * ratio * v_c, "v_y": 0.8 * ratio * v_c, "v_c": v_c, "f_n": load})
    assert np.hypot(y["f_x"], y["f_y"]) / load == pytest.approx(mu, abs=5e-6)  # five digits given
    assert y["f_x"] / y["f_y"] == pytest.approx(0.75, rel=1e-12)  # rounding: opposite to the slip


def test_normal_force_is_the_gradient_of_its_energy_and_never_pulls() -> None:
    d, rate = ca.SX.sym("d"), ca.SX.sym("rate")
    force, energy, loss = contact.normal_force(d, rate, 1e5, 1500.0, 1e-4)
    f = ca.Function("f", [d, rate], [force, ca.jacobian(energy, d), loss])
    for depth in (-1e-3, 0.0, 3e-5, 1e-4, 2e-3):
        elastic, slope, _ = (float(value) for value in f(depth, 0.0))
        assert elastic == pytest.approx(slope, rel=1e-12, abs=1e-12)  # rounding of a polynomial
        for speed in (-1.0, -0.01, 0.02):
            push, _, heat = (float(value) for value in f(depth, speed))
            assert push >= 0
            assert heat >= -1e-12  # rounding of a difference of forces
    assert float(f(2e-3, 0.0)[0]) == pytest.approx(200.0, rel=1e-12)  # beyond the onset: k d


@pytest.mark.parametrize(
    ("v_c", "known"), [(0.05, 3.64e-3), (0.02, 1.46e-3), (0.005, 0.364e-3), (0.002, 0.146e-3)]
)
def test_held_side_force_drifts_as_the_formula_says(v_c: float, known: float) -> None:
    """v = F v_c/(1.5 mu_s N): 118.6 kg at 0.5 m/s on a circle of 1 m, two of six wheels hold it."""
    force, load, mu_s = 118.6 * 0.25, 118.6 * 9.81 / 3, 0.7
    drift = force * v_c / (1.5 * mu_s * load)
    assert drift == pytest.approx(known, rel=4e-3)  # known to three digits
    wheel = oracle_of("wheel_contact/stick_slip")
    y = wheel.outputs({"v_x": 0.0, "v_y": -drift, "v_c": v_c, "mu_s": mu_s, "f_n": load})
    # the cubic term of mu(v) lowers the force by (v/v_c)^2/3
    assert y["f_y"] == pytest.approx(force, rel=(drift / v_c) ** 2)


def test_creep_is_linear_and_saturates() -> None:
    wheel = oracle_of("wheel_contact/creep")
    base = {"c_x": 1e-6, "c_y": 3e-5, "mu": 0.8, "f_n": 279.0, "rest": 1.0}
    y = wheel.outputs({**base, "v_x": 1e-8, "v_y": -3e-7})
    # far below the limit the law is linear but for (f/limit)^2/2 = 1e-9
    assert (y["f_x"], y["f_y"]) == (pytest.approx(-0.01, rel=1e-8), pytest.approx(0.01, rel=1e-8))
    y = wheel.outputs({**base, "v_x": 0.3, "v_y": 0.2})
    assert np.hypot(y["f_x"], y["f_y"]) == pytest.approx(0.8 * 279.0, rel=1e-6)  # 1e-7 left


def test_creep_may_fall_at_standstill() -> None:
    wheel = oracle_of("wheel_contact/rolling")
    base = {"c_y": 3e-5, "rest": 0.1, "v_creep": 0.02, "v_y": 1e-6}
    still = wheel.outputs(base)["f_y"]
    fast = wheel.outputs({**base, "speed": 100.0, "v_x": 10.0})["f_y"]
    assert still / fast == pytest.approx(10.0, rel=1e-5)  # (0.02/10)^2 is left


@pytest.mark.slow
def test_brush_sticks_at_rest_and_slips_sideways_when_it_rolls() -> None:
    """Held below its limit it only deflects; rolling, the slip is about kappa v F/k_t."""
    force, mass = 50.0, 20.0

    def drive(speed: float) -> np.ndarray:
        wheel = Stiff(
            "wheel_contact/brush",
            {"J_added": 1e6, "speed": speed / 0.1, "v_x": speed, "f_n": 200.0},
        )
        v, y, h, path = 0.0, 0.0, 1e-3, []
        for _ in range(2000):
            v += h / mass * (force + wheel.outputs()["f_y"])
            y += h * v
            wheel.set({"v_y": v})
            wheel.step(h)
            path.append(y)
        return np.array(path)

    deflection = force / 2e5
    still = drive(0.0)
    assert still[-1] == pytest.approx(deflection, rel=1e-3)  # the tail of the oscillation
    assert still[-1] - still[-500] == pytest.approx(0, abs=1e-3 * deflection)
    rolling = drive(0.5)
    transport, used = 40.0 * 0.5, 0.357  # 1/s; share of the limit, which takes the damping away
    slip = force / (2e5 / transport + 300.0 * (1 - used))
    # mu has fallen a little at this slip, so that `used` is good to 1 %
    assert (rolling[-1] - rolling[-500]) / 0.499 == pytest.approx(slip, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("wheel_contact/brush", {"mu_d": 0.0, "v_x": 0.7}),
        ("wheel_contact/brush+low_friction_patch",
         {"low_friction_patch.reduction": 1.0, "low_friction_patch.edge": 1e-2,
          "low_friction_patch.x_p": 0.0, "low_friction_patch.y_p": 0.0, "v_x": 0.5}),
    ],
)  # fmt: skip
def test_brush_on_a_floor_without_friction_slides_freely(
    name: str, values: dict[str, float]
) -> None:
    wheel = Stiff(name, {"J_added": 1e6, "speed": 0.0, "f_n": 200.0, **values})
    for _ in range(20):
        wheel.step(1e-3)
    # a thousandth of the load, where floors with friction hold half of it
    assert abs(wheel.outputs()["f_x"]) < 0.2


def test_every_drive_mass_that_springs_accept_can_be_moved() -> None:
    oracle = oracle_of("mobile_base/sprung")
    mass = next(v for v in oracle.model.of_role("parameter") if v.name == "drive_mass")
    assert mass.quantity.minimum is not None and mass.quantity.minimum > 0
    rates = oracle.derivatives({"drive_mass": mass.quantity.minimum})
    assert np.isfinite(list(rates.values())).all()


def test_brush_breaks_away_at_the_static_limit_and_slides_at_the_dynamic_one() -> None:
    still = {"tau": 0.0, "v_x": 0.0, "J_added": 1e6}
    wheel = Stiff("wheel_contact/brush", {**still, "v_y": 1e-3, "f_n": 200.0})
    slow = wheel.run(6.0, h=1e-2)["f_y"]
    wheel.set({"v_y": 0.5})
    fast = wheel.run(6.1, h=1e-3)["f_y"]
    assert -slow[-1] == pytest.approx(0.7 * 200, rel=1e-3)  # exp(-(v/v_s)^2) takes 7e-4
    assert -fast[-1] == pytest.approx(0.5 * 200, rel=1e-6)  # exp(-625) is left of the excess


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_wheel_spins_up_by_what_the_floor_does_not_take(fidelity: str) -> None:
    """(J_w + J_added) w' = tau - r f_x - c_rr N r tanh(w/w_rr), from the outputs alone."""
    wheel = oracle_of(f"wheel_contact/{fidelity}")
    values = {"tau": 1.3, "J_added": 0.03, "v_x": 0.5, "v_y": 0.02, "speed": 5.01, "c_rr": 0.015}
    values |= {"z": 0.098, "f_n": 200.0}
    y = wheel.outputs(values)
    resistance = 0.015 * y["f_z"] * 0.1 * np.tanh(5.01 / 0.1)
    expected = (1.3 - 0.1 * y["f_x"] - resistance) / (0.00716 + 0.03)
    assert wheel.derivatives(values)["speed"] == pytest.approx(expected, rel=1e-12)  # rounding


@pytest.mark.parametrize(
    ("variant", "values"),
    [
        ("wheel_contact/creep+toe_angle", {"toe_angle.delta": 0.2}),
        ("wheel_contact/creep", {"t_turn": 0.1, "w_z": -2.0}),  # it rolls where it pointed before
    ],
)
def test_forces_turn_with_the_direction_of_rolling(variant: str, values: dict[str, float]) -> None:
    straight = oracle_of("wheel_contact/creep")
    toed = oracle_of(variant)
    delta, v = 0.2, np.array([0.01, -0.02])
    turn = np.array([[np.cos(delta), -np.sin(delta)], [np.sin(delta), np.cos(delta)]])
    along = straight.outputs({"v_x": v[0], "v_y": v[1]})
    x, y = turn @ v
    turned = toed.outputs({"v_x": x, "v_y": y, **values})
    expected = turn @ [along["f_x"], along["f_y"]]
    assert [turned["f_x"], turned["f_y"]] == pytest.approx(list(expected), rel=1e-12)  # rounding


def test_low_friction_patch_acts_where_it_lies() -> None:
    wheel = oracle_of("wheel_contact/stick_slip+low_friction_patch")
    base = {"v_y": 0.5, "low_friction_patch.reduction": 0.8, "low_friction_patch.x_p": 1.0}

    def share(x: float, **shape: float) -> float:
        values = {**base, **{f"low_friction_patch.{n}": v for n, v in shape.items()}}
        away = wheel.outputs({**values, "x_w": 3.0})["f_y"]
        return wheel.outputs({**values, "x_w": x})["f_y"] / away

    # the edge's tanh is one but for 2 exp(-2 radius/edge) in the middle, and far outside
    assert share(1.0, radius=0.3, edge=0.03) == pytest.approx(0.2, rel=1e-7)
    assert share(1.3, radius=0.3, edge=0.03) == pytest.approx(0.6, rel=1e-7)
    # over 2.2 widths from a tenth to nine tenths
    assert share(1.3 - 0.033, radius=0.3, edge=0.03) == pytest.approx(1.0 - 0.8 * 0.9, abs=2e-3)
    assert share(1.3 + 0.033, radius=0.3, edge=0.03) == pytest.approx(1.0 - 0.8 * 0.1, abs=2e-3)


def test_eccentric_wheel_lifts_and_falls_with_its_angle() -> None:
    """On a given height the radius at the contact decides the load of the spatial contact."""
    wheel = oracle_of("wheel_contact/spatial+wheel_runout")
    loads = [
        wheel.outputs({"z": 0.099, "angle": angle, "wheel_runout.e": 5e-4})["f_z"]
        for angle in (0.0, np.pi / 2, np.pi)
    ]
    assert loads == pytest.approx([150.0, 100.0, 50.0], rel=1e-9)  # k (r + e cos phi - z)
