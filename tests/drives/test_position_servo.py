"""Position servos and the screw axis against laws written apart."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from sources.function import Oracle
from sources.screw_axis import elastic
from sources.variant import device_values
from tests.fmus import Slave, fmu
from tests.support import oracle_of


def ticked(oracle: Oracle, values: dict[str, float], clock: int = 0) -> dict[str, float]:
    """Discrete values after one tick."""
    names = [v.name for v in oracle.model.of_role("discrete")]
    after = oracle.functions.updates[clock](*oracle.arguments(values))
    return dict(zip(names, np.asarray(after).ravel().tolist(), strict=True))


CASCADE = {"K_p": 20.0, "K_v": 0.5, "K_u": 0.1, "u_max": 4.0, "T_loop": 2e-3}


@pytest.mark.parametrize(("q_ref", "u_add"), [(0.31, 0.0), (0.31, 0.7), (2.0, 0.0), (-2.0, 0.1)])
def test_cascade_is_position_loop_around_speed_loop(q_ref: float, u_add: float) -> None:
    oracle = oracle_of("position_servo/cascade")
    angles = (0.30, 0.299, 0.2975)  # now, one and two ticks ago
    values = {**CASCADE, "q_ref": q_ref, "u_add": u_add, "phi": angles[0],
              "phi_before": angles[1], "phi_before_last": angles[2], "started": 1.0}  # fmt: skip
    after = ticked(oracle, values)
    speed = (angles[0] - angles[2]) / (2 * 2e-3)
    wanted = 0.5 * (20.0 * (q_ref - angles[0]) - speed) + u_add
    expected = max(-4.0, min(wanted, 4.0))
    # rounding of sums of a few volts
    assert after["u_held"] == pytest.approx(expected, abs=1e-12)
    assert (after["phi_before"], after["phi_before_last"]) == angles[:2]
    outputs = oracle.outputs({**values, **after})
    assert outputs["tau"] == pytest.approx(0.1 * expected, abs=1e-12)


def test_cascade_is_at_rest_where_it_begins_whatever_the_angle() -> None:
    oracle = oracle_of("position_servo/cascade")
    values = {**CASCADE, "q_ref": 0.5, "phi": 0.5}
    for _ in range(3):
        after = ticked(oracle, values)
        assert after["u_held"] == 0.0
        values |= after
    # moved by 0.01 rad in one tick: a difference over two
    after = ticked(oracle, {**values, "phi": 0.51})
    assert after["u_held"] == pytest.approx(0.5 * (-20.0 * 0.01 - 0.01 / (2 * 2e-3)), abs=1e-12)


HOBBY = {"k_d": 2.0, "K_t": 0.3, "R_a": 4.0, "u_supply": 7.0}


@pytest.mark.parametrize(
    ("q_ref", "duty"), [(0.2, 0.2), (1.0, 1.0), (-3.0, -1.0)], ids=["linear", "full", "reverse"]
)
def test_proportional_sets_the_duty(q_ref: float, duty: float) -> None:
    oracle = oracle_of("position_servo/proportional")
    values = {**HOBBY, "q_ref": q_ref, "phi": 0.1, "w": 1.5}
    after = ticked(oracle, values)
    assert after["u_held"] == pytest.approx(7.0 * duty, abs=1e-12)  # rounding of a few volts
    current = (7.0 * duty - 0.3 * 1.5) / 4.0
    settled = {**values, **after, "current": current}
    assert oracle.derivatives(settled)["current"] == pytest.approx(0.0, abs=1e-9)  # over 5e-4 H
    assert oracle.outputs(settled)["tau"] == pytest.approx(0.3 * current, abs=1e-12)


R_A = 4.0
WINDING = {
    # effect: its values, voltage that a current takes at 7 V of command, shaft at rest
    "winding_heating": (
        {"r_th": 1.0, "p": 250.0, "t_th": 1e6, "alpha": 0.004},
        lambda i: 2.0 * R_A * i,
    ),
    "brush_drop": ({"u_b": 0.5, "i_0": 0.02}, lambda i: R_A * i + 0.5 * math.tanh(i / 0.02)),
    "battery_sag": ({"r_b": 3.0, "u_0": 7.0}, lambda i: (R_A + 3.0) * i),
    "pwm_dead_zone": ({"u_dz": 0.5}, lambda i: R_A * i + 0.5),
}


@pytest.mark.slow
@pytest.mark.parametrize("effect", WINDING)
@pytest.mark.parametrize("u", [0.2, 7.0])
def test_effects_on_the_winding_act_with_the_current_that_flows(effect: str, u: float) -> None:
    own, taken = WINDING[effect]
    values = {**HOBBY, "R_a": R_A, "u_held": u, "T_loop": 1.0, "k_d": u / 7.0, "q_ref": 1.0}
    values |= {f"{effect}.{name}": value for name, value in own.items()}
    with Slave(fmu(f"position_servo/proportional+{effect}"), values) as slave:
        slave.step(0.0, 5e-3)  # 50 time constants of the winding
        i, tau, loss = slave.get(["i", "tau", "P_loss"])
    if effect == "pwm_dead_zone" and u < 0.5:
        expected = 0.0
    elif effect == "battery_sag":
        expected = u / (R_A + 3.0 * (u / 7.0) ** 2)
    else:
        expected = brentq(lambda i: taken(i) - u, 0.0, 10.0)
    # the solver's tolerance of 1e-5, and a winding that warms by 2e-7 of its 250 K
    assert i == pytest.approx(expected, rel=1e-4, abs=1e-5)
    assert tau == pytest.approx(0.3 * i)
    assert loss >= 0.0


def test_open_bridge_gives_no_torque() -> None:
    oracle = oracle_of("position_servo/proportional+brush_drop")
    values = {**HOBBY, "u_held": 5.0, "w": 2.0, "current": 1.0, "brush_drop.u_b": 0.5}
    assert oracle.outputs({**values, "enable": 0.0})["tau"] == 0.0
    assert oracle.outputs({**values, "enable": 1.0})["tau"] != 0.0


def test_the_ball_screw_swings_as_its_values_say() -> None:
    """Two masses on a spring: 90 Hz and 1 %, as `ball_screw` says it is taken for."""
    values = {
        name: entry.value for name, entry in device_values("screw_axis", "ball_screw").items()
    }
    share = elastic.SHARE.start
    whole = values["M"] * (values["lead"] / (2 * math.pi)) ** 2
    between = share * (1 - share) * whole
    eigen = math.sqrt(values["k"] / between)
    assert eigen / (2 * math.pi) == pytest.approx(90.0, rel=0.02)  # two digits
    assert values["d"] * eigen / (2 * values["k"]) == pytest.approx(0.01, rel=0.05)


AXIS = {"lead": 0.005, "M": 40.0, "F_v": 150.0, "F_c": 12.0, "F_0": -3.0, "v_0": 1e-3}


@pytest.mark.slow
def test_rigid_axis_moves_as_a_mass_with_friction() -> None:
    """In metres, by another solver, where the component counts in radians of the screw."""
    times = np.linspace(0.0, 0.4, 9)
    torque = lambda t: 0.05 * math.sin(20.0 * t)  # noqa: E731
    oracle = oracle_of("screw_axis/rigid")
    found = oracle.simulate(times, AXIS, lambda t: {"tau": torque(t)})
    per_metre = 2 * math.pi / 0.005

    def rate(t: float, y: np.ndarray) -> list[float]:
        dry = 12.0 * math.tanh(y[1] / 1e-3)
        force = torque(t) * per_metre - 3.0 - 150.0 * y[1] - dry
        return [y[1], force / 40.0]

    expected = solve_ivp(rate, (0.0, 0.4), [0.0, 0.0], "BDF", times, rtol=1e-10, atol=1e-13)
    # 1e-7 of the travel: tolerances of both solvers over 0.4 s
    size = np.max(np.abs(expected.y[0]))
    np.testing.assert_allclose(found["x"], expected.y[0], rtol=0, atol=1e-7 * size)


@pytest.mark.slow
def test_a_stiff_screw_is_a_rigid_one() -> None:
    times = np.linspace(0.0, 0.2, 5)
    stiff = {"k": 1e4, "d": 1.0, "share": 0.4}
    found = {}
    for name, more in (("rigid", {}), ("elastic", stiff)):
        oracle = oracle_of(f"screw_axis/{name}")
        drive = lambda t: {"tau": 0.08 * math.sin(9.0 * t)}  # noqa: E731
        found[name] = oracle.simulate(times, {**AXIS, **more}, drive, rtol=1e-9)["x"]
    # the twist tau / k = 8e-6 rad is 6e-9 m of 16 mm
    np.testing.assert_allclose(found["elastic"], found["rigid"], rtol=0, atol=1e-8)


@pytest.mark.parametrize("variant", ["rigid", "elastic"])
def test_the_encoders_zero_shifts_the_ripple(variant: str) -> None:
    """A ripple once per turn repeats when the zero moves by one lead, and turns round by half."""
    oracle = oracle_of(f"screw_axis/{variant}+cogging@screw")
    ripple = {"screw.cogging.tau_c": 0.02, "screw.cogging.n": 1.0, "angle": 1.0}
    state = "speed" if variant == "rigid" else "w_c"

    def push(x_0: float) -> float:
        return oracle.derivatives({**AXIS, **ripple, "F_0": 0.0, "x_0": x_0})[state]

    assert push(0.005) == pytest.approx(push(0.0), rel=1e-9)  # rounding of the angle
    assert push(0.0025) == pytest.approx(-push(0.0), rel=1e-9)
