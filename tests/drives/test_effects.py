"""What the effects on shafts, windings, gears and springs do, against laws written apart."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sources.function import Oracle
from sources.model import ModelError, Role
from sources.variant import build_model
from tests.drives.closed_drive import ClosedDrive
from tests.fmus import Slave, fmu
from tests.support import oracle_of

pytestmark = pytest.mark.slow

Point = Mapping[str, float]


def torque_of(effect: str, point: Point) -> float:
    """Torque that an effect adds to a disc, from its acceleration."""
    with_effect = oracle_of(f"inertia/disc+{effect}")
    plain = oracle_of("inertia/disc")
    inertia = 0.08
    shared = {k: v for k, v in point.items() if "." not in k}
    return inertia * (with_effect.derivatives(point)["speed"] - plain.derivatives(shared)["speed"])


SHAFT_LAWS: dict[str, tuple[Point, Callable[[float, float, float], float]]] = {
    # effect: parameters, torque over (speed w, angle phi, transmitted torque tau)
    "viscous": ({"b": 0.2}, lambda w, phi, tau: -0.2 * w),
    "coulomb": ({"tau_c": 0.7, "w_0": 0.1}, lambda w, phi, tau: -0.7 * math.tanh(w / 0.1)),
    "stribeck": (
        {"tau_s": 0.4, "w_s": 2.0, "w_0": 0.1},
        lambda w, phi, tau: -0.4 * math.exp(-(w**2) / 4) * math.tanh(w / 0.1),
    ),
    "quadratic_drag": ({"c": 0.01}, lambda w, phi, tau: -0.01 * w * abs(w)),
    "load_friction": (
        {"mu": 0.1, "w_0": 0.1},
        lambda w, phi, tau: -0.1 * abs(tau) * math.tanh(w / 0.1),
    ),
    "asymmetric_coulomb": (
        {"tau_c": 0.5, "a": 0.6, "w_0": 1e-3},
        lambda w, phi, tau: -0.8 if w > 0 else 0.2,
    ),
    "asymmetric_viscous": ({"b_d": 0.03}, lambda w, phi, tau: 0.03 * (abs(w) - w)),
    "cogging": (
        {"tau_c": 0.1, "n": 7.0, "psi": 0.3},
        lambda w, phi, tau: -0.1 * math.sin(7 * phi + 0.3),
    ),
    "unbalance": ({"m_u": 0.2, "psi": 0.5}, lambda w, phi, tau: -0.2 * math.sin(phi + 0.5)),
    "temperature_drift": ({"b": 0.3, "h": 0.25}, lambda w, phi, tau: -0.3 * 0.75 * w),
}


@pytest.mark.parametrize("effect", SHAFT_LAWS)
@pytest.mark.parametrize("point", [(1.5, 0.4, 0.9), (-2.5, -3.0, -1.2)])
def test_torque_on_a_shaft(effect: str, point: tuple[float, float, float]) -> None:
    parameters, law = SHAFT_LAWS[effect]
    speed, angle, load = point
    values = {"speed": speed, "angle": angle, "tau": load}
    values |= {f"{effect}.{name}": value for name, value in parameters.items()}
    # rounding of accelerations near 50 rad/s2
    assert torque_of(effect, values) == pytest.approx(law(speed, angle, load), rel=1e-9)


@pytest.mark.parametrize(("speed", "angle", "tau"), [(1.5, 0.4, 0.9), (-0.2, -1.0, 0.3)])
def test_gear_friction_counts_both_sides(speed: float, angle: float, tau: float) -> None:
    """Of a pendulum: the motor's torque and the weight press the teeth together."""
    name = "gear_friction"
    own = {"mu": 0.2, "r": 0.6, "e": 0.5, "w_s": 0.4, "g": 2.0, "w_0": 0.05}
    arm = {"J": 0.05, "b": 0.0, "m": 0.5, "l": 0.1, "phi_0": 0.1}
    point = {**arm, "speed": speed, "angle": angle, "tau": tau}
    values = {**point, **{f"{name}.{key}": value for key, value in own.items()}}
    loaded = oracle_of(f"inertia/pendulum+{name}").derivatives(values)["speed"]
    plain = oracle_of("inertia/pendulum").derivatives(point)["speed"]
    weight = -0.5 * 9.81 * 0.1 * math.sin(angle - 0.1)
    load = abs(tau - 0.6 * weight)
    low = 1 + 0.5 * math.exp(-((speed / 0.4) ** 2))
    expected = -0.2 * load * (1 + 2.0 * load) * low * math.tanh(speed / 0.05)
    assert 0.05 * (loaded - plain) == pytest.approx(expected, rel=1e-9)  # rounding


def voltage_of(effect: str, point: Point) -> float:
    """Voltage that an effect adds to the winding, from the rate of the current."""
    with_effect = oracle_of(f"dc_motor/sampled+{effect}")
    plain = oracle_of("dc_motor/sampled")
    shared = {k: v for k, v in point.items() if "." not in k}
    return 2e-4 * (with_effect.derivatives(point)["current"] - plain.derivatives(shared)["current"])


WINDING_LAWS: dict[str, tuple[Point, Callable[[float, float, float], float]]] = {
    # effect: parameters, voltage over (current i, terminal voltage u, speed w)
    "winding_heating": (
        {"r_th": 2.0, "p": 25.0},
        lambda i, u, w: -0.1 * 0.00393 * 50.0 * i,
    ),
    "battery_sag": ({"r_b": 0.2}, lambda i, u, w: -0.2 * i * (u / 48) ** 2),
    "brush_drop": ({"u_b": 0.8, "i_0": 0.3}, lambda i, u, w: -0.8 * math.tanh(i / 0.3)),
    "pwm_dead_zone": ({"u_dz": 0.6}, lambda i, u, w: -math.copysign(min(abs(u), 0.6), u)),
    "torque_constant_saturation": (
        {"s": 0.2, "i_s": 15.0},
        lambda i, u, w: 0.13 * 0.2 * i**2 / (i**2 + 225) * w,
    ),
    "torque_ripple": (
        {"r": 0.05, "n": 4.0, "psi": 0.2, "theta": 0.7},
        lambda i, u, w: -0.13 * 0.05 * math.cos(4 * 0.7 + 0.2) * w,
    ),
}


@pytest.mark.parametrize("effect", WINDING_LAWS)
@pytest.mark.parametrize("point", [(8.0, 5.0, 30.0), (-3.0, 0.4, -20.0)])
def test_voltage_of_a_winding(effect: str, point: tuple[float, float, float]) -> None:
    parameters, law = WINDING_LAWS[effect]
    current, voltage, speed = point
    values = {"current": current, "set_voltage": voltage, "w": speed}
    values |= {f"{effect}.{name}": value for name, value in parameters.items()}
    # rounding of rates near 1e5 A/s
    assert voltage_of(effect, values) == pytest.approx(law(current, voltage, speed), rel=1e-9)


@pytest.mark.parametrize("order", [1, -1])
def test_laws_of_one_coefficient_act_one_after_the_other(order: int) -> None:
    """Saturated iron takes its share of the ripple, too: shares multiply."""
    names = ("torque_constant_saturation", "torque_ripple")[::order]
    values = {"current": 8.0, "set_voltage": 5.0, "w": 30.0}
    for name in names:
        values |= {f"{name}.{key}": value for key, value in WINDING_LAWS[name][0].items()}
    saturated, rippled = 1.0 - 0.2 * 64.0 / (64.0 + 225.0), 1.0 + 0.05 * math.cos(4 * 0.7 + 0.2)
    expected = 0.13 * (1.0 - saturated * rippled) * 30.0
    assert voltage_of("+".join(names), values) == pytest.approx(expected, rel=1e-9)


def test_a_warm_winding_settles_where_heat_in_is_heat_out() -> None:
    oracle = oracle_of("dc_motor/sampled+winding_heating")
    current, r_th, alpha = 20.0, 1.5, 0.00393
    hot = 0.1 * current**2 / (1 - alpha * r_th * 0.1 * current**2)  # p = R (1 + alpha r_th p) i^2
    values = {"current": current, "winding_heating.p": hot}
    assert oracle.derivatives(values)["winding_heating.p"] == pytest.approx(0.0, abs=1e-12)
    assert oracle.outputs(values)["winding_heating.rise"] == pytest.approx(r_th * hot)


@pytest.mark.parametrize(
    ("effect", "measured"),
    [("current_offset", 3.0 + 0.2), ("current_gain", 3.0 * 1.02)],
)
def test_a_wrong_current_sensor_misleads_its_loop(effect: str, measured: float) -> None:
    """The loop brings the measured current to its set value, so the true one is off."""
    oracle = oracle_of(f"dc_motor/electrical+{effect}")
    point = {"current": 3.0, "current_integral": 0.0}
    assert oracle.outputs(point)["i_measured"] == pytest.approx(measured, rel=1e-12)
    assert oracle.outputs(point)["i"] == 3.0
    assert oracle.outputs(point)["u"] == pytest.approx(-0.19 * measured, rel=1e-12)


def test_transmission_error_turns_the_motor_by_its_own_shape() -> None:
    """Integrated over the output angle, w_a / w_b gives ratio (theta + eps sin(n theta))."""
    oracle = oracle_of("gearbox/ratio+mesh_ripple")
    values = {"w_b": 2.0, "mesh_ripple.n": 5.0, "mesh_ripple.eps": 0.01}
    times = np.linspace(0.0, 1.0, 2001)
    run = oracle.simulate(times, values)
    angle = np.concatenate(
        [[0.0], np.cumsum((run["w_a"][1:] + run["w_a"][:-1]) / 2) * (times[1] - times[0])]
    )
    expected = 10.167 * (2 * times + 0.01 * np.sin(10 * times))
    # trapezoidal rule: h^2 / 12 times the second derivative of 10 rad/s3, over 1 s
    np.testing.assert_allclose(angle, expected, atol=1e-5)


def disc_under_torque(
    effect: str, torque: Callable[[float], float], end: float
) -> dict[str, np.ndarray]:
    """A disc without other friction, sampled every 10 ms."""
    oracle = oracle_of(f"inertia/disc+{effect}")
    times = np.linspace(0.0, end, round(end / 0.01) + 1)
    return oracle.simulate(times, {"b": 0.0}, lambda t: {"tau": torque(t)}, rtol=1e-6, atol=1e-11)


def test_bristle_sticks_and_coulomb_creeps() -> None:
    """0.5 N.m of sliding friction under 0.45 N.m."""
    stuck = disc_under_torque("bristle", lambda t: 0.45, 2.0)
    creeping = disc_under_torque("coulomb", lambda t: 0.45, 2.0)
    assert creeping["speed"][-1] == pytest.approx(2e-3 * math.atanh(0.9), rel=1e-6)
    # it may slip while it settles, by a few times its length of 5e-4 rad, but comes to rest
    assert stuck["angle"][-1] < 2e-3
    assert abs(stuck["speed"][-1]) < 1e-8


def test_bristle_does_not_drift_under_a_load_that_varies() -> None:
    """LuGre's model creeps here; elasto-plastic presliding must not."""
    run = disc_under_torque("bristle", lambda t: 0.2 + 0.1 * math.sin(8 * math.pi * t), 2.0)
    angle = run["angle"][[100, 125, 150, 175, 200]]  # the same phase of five periods
    # elastic motion is 2e-4 rad; the solver's tolerance leaves 1e-6 of it per period
    assert np.ptp(angle) < 1e-9


@pytest.mark.parametrize("speed", [1.0, 5.0, 20.0])
def test_bristle_slides_at_its_torque_whatever_the_solver_of_its_host(speed: float) -> None:
    """The bristle follows in x_0 / speed, 25 to 500 us here, and the steps have 1 ms."""
    with Slave(fmu("adapter/torque+bristle"), {"u": 0.0, "w": speed}) as slave:
        for k in range(20):
            slave.step(k * 1e-3, 1e-3)
            if k > 10:
                # what is left of Stribeck's excess at 1 rad/s and the solver's tolerance of 1e-6
                assert slave.get(["y"])[0] == pytest.approx(-0.5, rel=1e-5)


def test_bristle_on_a_fast_shaft_that_turns_over_dissipates_what_friction_may() -> None:
    """Speeds of 300 rad/s that change by 1.9 in each step: fixed steps of Rodas3 ran away there."""
    with Slave(fmu("gearbox/ratio+bristle@flange_b")) as slave:
        for k in range(500):
            speed = 300.0 * math.sin(2 * math.pi * k * 1e-3)
            slave.set({"w_b": speed})
            slave.step(k * 1e-3, 1e-3)
            # breakaway takes 1.3 times the sliding torque, the stuck bristle's damper comes on top
            # below v_s, where neither has power; 1 W is that of two steps around standstill
            loss = slave.get(["flange_b.bristle.P_loss"])[0]
            assert loss <= 0.5 * abs(speed) * (1 + 1e-6) + 1.0


def test_bristle_breaks_away_at_its_maximum_and_then_slides() -> None:
    held = disc_under_torque("bristle", lambda t: 0.64 * min(t, 1), 1.5)
    gone = disc_under_torque("bristle", lambda t: 0.66 * min(t, 1), 1.5)
    # breakaway is at 0.5 N.m times (1 + 0.3)
    assert held["angle"][-1] < 5e-3
    assert abs(held["speed"][-1]) < 1e-2
    assert gone["speed"][-1] > 0.5
    acceleration = (gone["speed"][-1] - gone["speed"][-2]) / 0.01
    assert acceleration == pytest.approx((0.66 - 0.5) / 0.08, rel=1e-3)


def test_friction_fades_while_the_shaft_turns_and_returns_at_rest() -> None:
    oracle = oracle_of("inertia/disc+temperature_drift")
    rate = "temperature_drift.h"
    assert oracle.derivatives({"speed": 1.0})[rate] == pytest.approx(0.5 / 60)
    assert oracle.derivatives({"temperature_drift.h": 0.6})[rate] == pytest.approx(-0.01)


AT_REST = {"tau_a": 0.0, "w_b": 0.0}
"""Inputs of a gearbox that nothing turns; alone, it carries a torque."""


@pytest.mark.parametrize(("twist", "torque"), [(1e-3, 0.0), (-1.5e-3, 0.0), (2.5e-3, 6.0)])
def test_backlash_leaves_a_gap(twist: float, torque: float) -> None:
    oracle = oracle_of("gearbox/elastic+backlash")
    out = oracle.outputs({"twist": twist, "backlash.gap": 3e-3, **AT_REST})
    assert out["tau_b"] == pytest.approx(torque, abs=1e-12)  # 6000 N.m/rad beyond 1.5 mrad


@pytest.mark.parametrize("name", ["backlash+{}", "{}+backlash"])
@pytest.mark.parametrize(
    ("effect", "own"), [("cubic_stiffness", {}), ("hysteresis", {"hysteresis.z": 1.0})]
)
def test_teeth_that_do_not_touch_transmit_nothing(
    name: str, effect: str, own: dict[str, float]
) -> None:
    """Beyond the play the spring is as without it, with what else acts on it."""
    both = oracle_of("gearbox/elastic+" + name.format(effect))
    alone = oracle_of(f"gearbox/elastic+{effect}")

    def torque(oracle: Oracle, twist: float, **more: float) -> float:
        return oracle.outputs({"twist": twist, **own, **more})["tau_b"]

    for gap in (3e-3, 20e-3):
        play = {"backlash.gap": gap}
        assert torque(both, 0.4 * gap, **play) == 0.0
        for side in (1, -1):
            wound = torque(both, side * (gap / 2 + 2e-3), **play)
            # rounding of the difference of two deflections
            assert wound == pytest.approx(torque(alone, side * 2e-3), rel=1e-9)


def test_spring_that_stiffens() -> None:
    oracle = oracle_of("gearbox/elastic+cubic_stiffness")
    out = oracle.outputs({"twist": 2e-3, "cubic_stiffness.k_3": 1e9, **AT_REST})
    assert out["tau_b"] == pytest.approx(6000 * 2e-3 + 1e9 * 8e-9, rel=1e-12)


def test_hysteresis_loses_the_area_of_its_loop() -> None:
    """Slow cycles of the twist between blocked ends: 4 tau_h (A - x) per cycle.

    x is between 0 and the deflection 2 x_h over which the loop turns.
    """
    width, length, amplitude = 0.5, 5e-4, 0.01
    oracle = oracle_of("gearbox/elastic+hysteresis")
    names = oracle.state_names

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        twist_rate = amplitude * math.cos(t)
        values = {
            "twist": amplitude * math.sin(t),
            "rotor_speed": 10.167 * twist_rate,
            "hysteresis.z": y[0],
            **AT_REST,
        }
        args = oracle.arguments(values)
        xdot, out = oracle.functions.outputs(*args)
        loss = float(out[oracle.output_names.index("hysteresis.P_loss")])
        return np.array([float(xdot[names.index("hysteresis.z")]), loss])

    run = solve_ivp(rate, (0.0, 4 * math.pi), [0.0, 0.0], rtol=1e-7, atol=1e-10, max_step=0.01)
    second_cycle = run.y[1, -1] - np.interp(2 * math.pi, run.t, run.y[1])
    full = 4 * width * amplitude
    assert full - 4 * width * 2 * length < second_cycle < full


def test_effects_find_their_natural_balance() -> None:
    assert "coulomb.tau_c" in build_model("gearbox/elastic+coulomb").variables
    assert "flange_a.coulomb.tau_c" in build_model("gearbox/elastic+coulomb@flange_a").variables
    with pytest.raises(ModelError, match="adds A, but balance 'speed_sensor' is in rad/s"):
        build_model("dc_motor/sampled+current_offset@speed_sensor")
    with pytest.raises(ModelError, match="acts on compliance"):
        build_model("gearbox/ratio+backlash")


def test_unbalance_wherever_it_sits_is_the_same() -> None:
    """On the gearbox, which knows only the speed, the effect integrates the angle itself."""
    results = []
    for gearbox, load, key in (
        ("gearbox/ratio", "inertia/disc+unbalance", "load.unbalance"),
        ("gearbox/ratio+unbalance@flange_b", "inertia/disc", "gear.flange_b.unbalance"),
    ):
        drive = ClosedDrive("dc_motor/electrical", load, gearbox, {f"{key}.m_u": 2.0})
        run = solve_ivp(
            lambda _, x, drive=drive: np.asarray(drive.rate(x, [], 30.0)).ravel(),
            (0.0, 0.5),
            drive.start,
            method="Radau",
            rtol=1e-8,
            atol=1e-9,
        )
        results.append(run.y[drive.states.index("load.speed"), -1])
    assert results[0] == pytest.approx(results[1], rel=1e-6)  # a hundred times the solver's


def test_wheels_that_roll_have_no_magnets() -> None:
    with pytest.raises(ModelError, match=r"'cogging' has no place at balance 'axle', .* normal"):
        build_model("caster/swivel+cogging@axle")
    build_model("inertia/disc+cogging@flange")  # a rotor's may have


@pytest.mark.parametrize("speed", [1.5, -2.5])
@pytest.mark.parametrize("strength", [0.3, -0.3])
@pytest.mark.parametrize(
    ("effect", "name", "law"),
    [
        ("asymmetric_viscous", "b_d", lambda s, w: s * abs(w) - abs(s) * w),
        ("temperature_drift", "b", lambda s, w: -(0.75 * s if s > 0 else -0.25 * s) * w),
    ],
)
def test_friction_of_either_sign_never_drives(
    effect: str, name: str, law: Callable[[float, float], float], strength: float, speed: float
) -> None:
    values = {"speed": speed, f"{effect}.{name}": strength}
    if effect == "temperature_drift":
        values[f"{effect}.h"] = 0.25
    torque = torque_of(effect, values)
    # rounding of accelerations near 50 rad/s2
    assert torque == pytest.approx(law(strength, speed), rel=1e-9, abs=1e-12)
    assert torque * speed <= 1e-12


DISSIPATIVE = {
    "asymmetric_coulomb": "inertia/disc",
    "asymmetric_viscous": "inertia/disc",
    "battery_sag": "dc_motor/electrical",
    "bearing_drag": "inertia/disc",
    "bristle": "inertia/disc",
    "coulomb": "inertia/disc",
    "load_friction": "inertia/disc",
    "quadratic_drag": "inertia/disc",
    "stribeck": "inertia/disc",
    "temperature_drift": "inertia/disc",
    "viscous": "inertia/disc",
}


@pytest.mark.parametrize("effect", DISSIPATIVE)
def test_no_permitted_parameter_makes_a_loss_a_gain(effect: str) -> None:
    """A fit may go anywhere between the bounds: a source of energy makes a limit cycle there."""
    random = np.random.default_rng(5)
    plain = build_model(DISSIPATIVE[effect])
    model = build_model(f"{DISSIPATIVE[effect]}+{effect}")
    with_effect, without = Oracle(model), Oracle(plain)
    roles: tuple[Role, ...] = ("state", "discrete", "input", "parameter")
    known = {v.name for role in roles for v in plain.of_role(role)}
    lost = []
    for _ in range(200):
        point = {}
        for v in (v for role in roles for v in model.of_role(role)):
            span = 3.0 * (abs(v.start) or 1.0)
            low, high = v.quantity.minimum, v.quantity.maximum
            low = -span if low is None else low
            point[v.name] = random.uniform(low, low + 2.0 * span if high is None else high)
        if f"{effect}.h" in point:  # the share of warmth
            point[f"{effect}.h"] = random.uniform()
        shared = {k: v for k, v in point.items() if k in known}
        lost.append(with_effect.outputs(point)["P_loss"] - without.outputs(shared)["P_loss"])
    assert min(lost) > -1e-9 * max(lost) and max(lost) > 0.0  # rounding


@pytest.mark.parametrize("variant", ["adapter/torque+bristle", "screw_axis/elastic+hysteresis"])
def test_the_state_of_an_absent_effect_rests(variant: str) -> None:
    """It may be too fast for the solver's step, which is that of the system without it."""
    model = build_model(variant)
    (strength,) = model.stiff
    (state,) = (v.name for v in model.of_role("state") if v.of_effect)
    moving = {v.name: 1.0 + k for k, v in enumerate(model.of_role("input"))}
    moving |= {v.name: 2.0 + k for k, v in enumerate(model.of_role("state")) if not v.of_effect}
    oracle = oracle_of(variant)
    assert oracle.derivatives({**moving, strength: 0.0})[state] == 0.0
    assert oracle.derivatives({**moving, strength: 0.1})[state] != 0.0
