"""Fidelities of the crawler: kinematics, track contact, symmetry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq, fsolve

from sources import crawler
from sources.crawler import track_contact
from sources.function import Oracle
from sources.model import Model
from sources.tools.crawler_identification import quasi_static_shift
from sources.variant import device_values
from tests.support import oracle_of

pytestmark = pytest.mark.slow

FIDELITIES = ("two_wheeled", "slip_law", "skid", "track_contact")
RPM = np.pi / 30
# V, w_z, R, R_S, then after 5 s: beta, O1, S; inputs from Table 2
VECTORS = {
    (31.62 * RPM, 12.32 * RPM, 0.0344, 0.0011): (
        0.066695380, 0.277844033, 0.240046114, 0.252246679, 1.389220166,
        0.236099826, 0.196698576, 0.222104872, 0.120472653,
    ),
    (38.59 * RPM, 4.95 * RPM, 0.0364, 0.0012): (
        0.062227473, 0.479815244, 0.129690488, 0.151082337, 2.399076218,
        0.087689456, 0.225242473, 0.144789086, 0.172841306,
    ),
    (19.40 * RPM, 0.0, 0.0968, -0.0040): (
        0.020265346, 0.222696113, 0.091000000, 0.119529285, 1.113480565,
        0.081648925, 0.050819742, 0.047429474, -0.018716430,
    ),
}  # fmt: skip


def oracle(variant: str) -> Oracle:
    return oracle_of(f"crawler{variant}")


@pytest.fixture(scope="module")
def two_wheeled() -> Oracle:
    return oracle("/two_wheeled")


@pytest.mark.parametrize("case", VECTORS)
def test_vectors(two_wheeled: Oracle, case: tuple[float, ...]) -> None:
    w2, w3, e2, e3 = case
    v, w_z, radius, radius_s, *end = VECTORS[case]
    run = two_wheeled.simulate(
        [0.0, 5.0], {"w2": w2, "w3": w3, "e_right": e2, "e_left": e3}, method="DOP853"
    )
    # the vectors are printed to nine decimals
    assert run["v"][0] == pytest.approx(v, abs=1e-9)
    assert run["w_z"][0] == pytest.approx(w_z, abs=1e-9)
    assert run["v"][0] / run["w_z"][0] == pytest.approx(radius, abs=1e-9)
    got = [run[name][-1] for name in ("beta", "x", "y", "x_S", "y_S")]
    np.testing.assert_allclose(got, end, atol=1e-9)
    assert np.hypot(run["x_S"][-1], run["y_S"][-1] - radius) == pytest.approx(radius_s, abs=2e-9)


def test_circle_closes_and_follows_the_exact_step(two_wheeled: Oracle) -> None:
    values = {"w2": 3.3, "w3": 1.3, "pose_x": 0.3, "pose_y": -0.1, "pose_beta": 0.7, "x_V": 0.02}
    first = two_wheeled.outputs(values)
    v, w_z = first["v"], first["w_z"]
    times = np.linspace(0.0, 2 * np.pi / w_z, 9)
    run = two_wheeled.simulate(times, values, method="DOP853")
    # S runs on a circle about the rotation centre at (x_V, v/w_z) in body axes
    beta = 0.7 + w_z * times
    c, s = np.cos(0.7), np.sin(0.7)
    centre = np.array([0.3 + c * 0.02 - s * v / w_z, -0.1 + s * 0.02 + c * v / w_z])
    arm = np.array([-0.02, -v / w_z])
    x = centre[0] + np.cos(beta) * arm[0] - np.sin(beta) * arm[1]
    y = centre[1] + np.sin(beta) * arm[0] + np.cos(beta) * arm[1]
    # integrator tolerance 1e-11 relative on paths of 1.5 m
    np.testing.assert_allclose(run["x"], x, atol=1e-9)
    np.testing.assert_allclose(run["y"], y, atol=1e-9)
    assert run["x_S"][-1] == pytest.approx(run["x_S"][0], abs=1e-9)
    assert run["y_S"][-1] == pytest.approx(run["y_S"][0], abs=1e-9)


def test_shifts_of_skid_inverted_by_two_wheels() -> None:
    skid, wheels = oracle("/skid"), oracle("/two_wheeled")
    for i_right, i_left in ((0.13, 0.0), (0.095, -0.028), (0.155, 0.157), (-0.2, 0.3)):
        speeds = {"w2": 4.0, "w3": 0.9}
        got = skid.outputs({**speeds, "i_right": i_right, "i_left": i_left})
        back = wheels.outputs(
            {**speeds, "e_right": max(got["e2"], -0.04), "e_left": max(got["e3"], -0.04)}
        )
        if min(got["e2"], got["e3"]) < -0.04:
            continue  # beyond what the virtual wheels may be set to
        # e2, e3 fade below a yaw rate of 1e-5 rad/s: (1e-5/0.3)^2 relative
        assert back["v"] == pytest.approx(got["v"], rel=2e-9)
        assert back["w_z"] == pytest.approx(got["w_z"], rel=2e-9)
    # the definition, Eq 2: i = (r w - V)/max(r w, V) for both signs
    y = skid.outputs({"w2": 4.0, "w3": 2.0, "i_right": 0.2, "i_left": -0.1})
    track_right = y["v"] + 0.19 / 2 * y["w_z"]
    track_left = y["v"] - 0.19 / 2 * y["w_z"]
    assert (0.031 * 4 - track_right) / (0.031 * 4) == pytest.approx(0.2, rel=1e-12)
    assert (0.031 * 2 - track_left) / track_left == pytest.approx(-0.1, rel=1e-12)


def test_slip_law_meets_the_tables_it_was_fitted_to() -> None:
    law = oracle("/slip_law")
    locked = law.outputs({"w2": 2.04, "w3": 0.0})
    assert (locked["e2"], locked["e3"]) == pytest.approx((0.0928, -0.0043), abs=1e-9)
    turning = law.outputs({"w2": 4.03, "w3": 0.52})
    # k = exp(-(0.52/0.1)^2) = 2e-12 of the locked values remain
    assert turning["e2"] == pytest.approx(0.0280 + 0.00368 * 3.51, abs=1e-11)
    assert turning["e3"] == pytest.approx(0.0, abs=1e-11)
    spot = law.outputs({"w2": 2.0, "w3": -2.0})
    assert spot["e2"] == spot["e3"] and spot["v"] == 0.0


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_mirrored_turn(fidelity: str) -> None:
    model = oracle(f"/{fidelity}")
    names = [v.name for v in model.model.of_role("parameter")]
    left = {"w2": 3.0, "w3": 0.8}
    right = {"w2": 0.8, "w3": 3.0}
    for a, b in (("e_right", "e_left"), ("i_right", "i_left")):
        if a in names:
            left |= {a: 0.03, b: 0.01}
            right |= {a: 0.01, b: 0.03}
    times = [0.0, 1.0, 2.0]
    # friction at rest is stiff for track_contact; its tolerance bounds the asymmetry
    one, other = (model.simulate(times, v, rtol=1e-9, atol=1e-11) for v in (left, right))
    np.testing.assert_allclose(one["x"], other["x"], atol=1e-8)
    np.testing.assert_allclose(one["y"], -other["y"], atol=1e-8)
    np.testing.assert_allclose(one["beta"], -other["beta"], atol=1e-8)
    np.testing.assert_allclose(one["e2"], other["e3"], atol=1e-6)
    assert abs(one["beta"][-1]) > 0.1


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_equal_speeds_go_straight(fidelity: str) -> None:
    model = oracle(f"/{fidelity}")
    # skid coefficients belong to the sides: equal ones are needed to go straight
    values = {"i_right": 0.1, "i_left": 0.1} if fidelity == "skid" else {}
    run = model.simulate([0.0, 0.5], {"w2": 2.0, "w3": 2.0, "pose_beta": 0.4, **values}, rtol=1e-9)
    assert run["beta"][-1] == pytest.approx(0.4, abs=1e-12)  # rounding only
    assert run["y"][-1] == pytest.approx(run["x"][-1] * np.tan(0.4), rel=1e-9)
    full = 2.0 * 0.031 * 0.5
    if fidelity == "track_contact":  # starts at rest: mu g = 5.9 m/s2 takes 11 ms to get there
        assert 0.95 * full < np.hypot(run["x"][-1], run["y"][-1]) < full
    else:
        share = 0.9 if fidelity == "skid" else 1.0
        assert np.hypot(run["x"][-1], run["y"][-1]) == pytest.approx(share * full, rel=1e-9)


def contact_model(road_wheels: int, **values: float) -> Oracle:
    start = {key: origin.value for key, origin in device_values("crawler", "paper").items()}
    model = Model(
        crawler.COMPONENT,
        "track_contact",
        values={**start, "road_wheels": road_wheels, **values},
    )
    track_contact.equations(model)
    return Oracle(model.finish())


SLOW = 0.03  # so slow that the centripetal force is 3e-6 of the friction


def steady(model: Oracle, w2: float, w3: float, **values: float) -> dict[str, float]:
    """Outputs where the accelerations vanish, in slow motion."""
    names = ("vel_x", "vel_y", "yaw_rate")
    w2, w3 = SLOW * w2, SLOW * w3
    w_z = 0.8 * 0.031 * (w2 - w3) / 0.19
    inputs = {"w2": w2, "w3": w3, "u_0": 1e-6, "v_r": 1e-5, **values}

    def rates(x: np.ndarray) -> list[float]:
        d = model.derivatives({**inputs, **dict(zip(names, x, strict=True))})
        return [d[name] for name in names]

    x, _, found, message = fsolve(
        rates, [0.0155 * (w2 + w3), 0.0, w_z], xtol=1e-13, full_output=True
    )
    assert np.abs(rates(x)).max() < 1e-9, message
    assert found
    return model.outputs({**inputs, **dict(zip(names, x, strict=True))})


N = 200  # road wheels; as midpoint rule for a uniform pressure: error about (l/N/e)^2/24 < 1e-4


def half_length(length: float) -> float:
    return length / 2 * (N - 1) / N


@pytest.mark.parametrize("length", [0.15, 0.20, 0.25])
def test_uniform_pressure_gives_the_asinh_formulas(length: float) -> None:
    model = contact_model(N, a=half_length(length))
    want = quasi_static_shift(0.19, length)
    for w2, w3 in ((3.3, 1.3), (4.0, 0.5), (4.8, -0.5)):
        y = steady(model, w2, w3)
        assert (y["e2"], y["e3"]) == pytest.approx((want, want), rel=2e-4)
        assert y["x_axis"] == pytest.approx(0.0, abs=1e-6)  # centripetal force


def test_rolling_resistance_parts_the_shifts() -> None:
    length, ratio = 0.20, 0.3

    def along(e: float) -> float:
        return 2 * e / length * np.arcsinh(length / (2 * e))

    def arm(e: float) -> float:
        root = np.hypot(length / 2, e)
        return (length / 2 * root - e**2 * np.arcsinh(length / (2 * e))) / length

    def balance(e: np.ndarray) -> list[float]:
        e2, e3 = e
        return [
            along(e2) - along(e3) - 2 * ratio,
            0.19 / 2 * (along(e2) + along(e3)) - arm(e2) - arm(e3),
        ]

    want = fsolve(balance, [0.04, 0.005])
    model = contact_model(N, a=half_length(length))
    y = steady(model, 4.0, 1.5, f_r=ratio * 0.6, mu=0.6)
    assert (y["e2"], y["e3"]) == pytest.approx(tuple(want), rel=1e-2)  # e3 = 3 spacings only
    assert y["e2"] > 4 * y["e3"] > 0


def test_the_axis_moves_further_than_the_load() -> None:
    length, c = 0.20, 0.005
    model = contact_model(N, a=half_length(length))
    y = steady(model, 4.0, 0.5, x_G=c)
    e = (y["e2"] + y["e3"]) / 2

    def lateral(x0: float) -> float:
        return quad(
            lambda x: (1 + 12 * c * x / length**2) * (x - x0) / np.hypot(x - x0, e),
            -length / 2, length / 2, epsabs=1e-12,
        )[0]  # fmt: skip

    x0 = brentq(lateral, -0.05, 0.05)
    assert 1.3 < x0 / c < 1.5
    # midpoint rule: 1e-4 of the length
    assert y["x_axis"] == pytest.approx(x0, rel=5e-3)


def test_lab_vehicle_settles_at_the_quasi_static_turn_and_its_drives_pay_for_the_friction() -> None:
    model = oracle(".lab/track_contact")
    run = model.simulate(np.linspace(0.0, 1.5, 4), {"w2": 3.3, "w3": 1.28}, rtol=1e-9, atol=1e-11)
    declared = device_values("crawler", "lab")["e_right"].value
    for name in ("e2", "e3"):  # what the simpler fidelities of this device are given
        assert run[name][-1] == pytest.approx(declared, abs=5e-5)  # its last digit
    assert run["E_stored"][-1] == pytest.approx(run["E_stored"][-2], rel=1e-6)
    assert run["P_in"][-1] == pytest.approx(run["P_loss"][-1], rel=1e-6)
    assert run["tau2"][-1] > 0 > run["tau3"][-1]  # the outer track pulls, the inner one brakes


def test_loads_carry_weight_and_moments() -> None:
    model = oracle(".lab/track_contact+load_shift")
    # sideways shift by a quarter of the track: the left side carries three quarters
    shift = {"load_shift.shift": 0.07, "load_shift.direction": np.pi / 2}
    still = {"w2": 2.0, "w3": 2.0}
    y = model.outputs({**still, **shift})
    total = 0.65 * 15 * 9.81 * 0.055
    assert y["tau3"] == pytest.approx(0.75 * total, rel=1e-12)
    assert y["tau2"] == pytest.approx(0.25 * total, rel=1e-12)
    # beyond the track the right side lifts off and carries nothing
    y = model.outputs({**still, **shift, "load_shift.shift": 0.15})
    assert y["tau2"] == 0.0


def test_speed_gain_of_one_side_turns_the_vehicle_and_keeps_the_books() -> None:
    model = oracle(".lab/track_contact+gain@speed_left")
    run = model.simulate(
        [0.0, 1.0], {"w2": 2.0, "w3": 2.0, "speed_left.gain.error": 0.05}, rtol=1e-9, atol=1e-11
    )
    assert run["beta"][-1] < -1e-3  # the faster left track turns it right


@pytest.mark.parametrize("effect", ["friction_asymmetry", "friction_anisotropy"])
def test_friction_effects_act(effect: str) -> None:
    model = oracle(f".lab/track_contact+{effect}")
    strength = next(v.name for v in model.model.of_role("parameter") if v.quantity.strength)
    moving = {"w2": 3.0, "w3": 1.0, "vel_x": 0.1, "yaw_rate": 0.3}
    bare = model.derivatives({**moving, strength: 0.0})
    some = model.derivatives({**moving, strength: 0.2})
    assert abs(some["yaw_rate"] - bare["yaw_rate"]) > 1e-2
    if effect == "friction_anisotropy":  # more grip across the track resists the turn
        assert some["yaw_rate"] < bare["yaw_rate"]
        assert some["vel_x"] == pytest.approx(bare["vel_x"], abs=1e-12)


@pytest.mark.parametrize("speed", [0.0, 0.5])
def test_turning_friction_is_the_same_at_every_speed_along(speed: float) -> None:
    """M_t tanh(w/w_0) against the turn, on the yaw inertia alone: no force, nothing at rest."""
    model = oracle(".lab/track_contact+turning_friction")
    values = {"vel_x": speed, "vel_y": 0.1, "w2": 3.0, "yaw_inertia": 0.5}
    for rate in (0.03, -2.0, 0.0):
        state = {**values, "yaw_rate": rate}
        some, bare = (
            model.derivatives({**state, "turning_friction.M_t": size}) for size in (1.5, 0.0)
        )
        torque = -1.5 * math.tanh(rate / 0.01)
        assert some["yaw_rate"] - bare["yaw_rate"] == pytest.approx(torque / 0.5, abs=1e-9)
        assert some["vel_x"] == bare["vel_x"] and some["vel_y"] == bare["vel_y"]
        out = model.outputs({**state, "turning_friction.M_t": 1.5})
        assert out["turning_friction.P_loss"] == pytest.approx(-torque * rate, rel=1e-12)


@pytest.mark.parametrize("toes", [(0.0, 0.0), (0.05, 0.0), (0.03, -0.08)])
def test_tracks_that_stand_askew_push_along_their_own_axes(toes: tuple[float, float]) -> None:
    """Road wheel by road wheel, with forces as complex numbers in world axes."""
    values = {name: origin.value for name, origin in device_values("crawler", "lab").items()}
    r, width, a, mu, mass, inertia = (
        float(values[n]) for n in ("r", "B", "a", "mu", "mass", "yaw_inertia")
    )
    count, gravity, f_r = int(values["road_wheels"]), 9.81, 0.04
    v_x, v_y, w_z, speeds = 0.12, 0.03, 0.4, (3.0, 1.5)
    force, moment = 0j, 0.0
    for side, speed, toe in zip((-1, 1), speeds, toes, strict=True):
        way = complex(math.cos(toe), math.sin(toe))
        for k in range(count):
            place = 1j * side * width / 2 + a * (2 * k / (count - 1) - 1) * way
            moving = complex(v_x, v_y) + 1j * w_z * place
            slide = moving - r * speed * way
            along = (moving * way.conjugate()).real
            load = mass * gravity / (2 * count)
            push = -mu * load * slide / max(abs(slide), 1e-3)
            push -= f_r * load * math.tanh(along / 5e-3) * way
            force += push
            moment += (place.conjugate() * push).imag
    names = ("toe_right", "toe_left")
    variant = "".join(f"+toe_angle@{name}" for name in names)
    given = {f"{n}.toe_angle.delta": d for n, d in zip(names, toes, strict=True)}
    found = oracle(f".lab/track_contact{variant}").derivatives(
        {"vel_x": v_x, "vel_y": v_y, "yaw_rate": w_z, "w2": speeds[0], "w3": speeds[1],
         "f_r": f_r, "x_G": 0.0, "y_G": 0.0, **given}
    )  # fmt: skip
    turned = complex(found["vel_x"], found["vel_y"]) + 1j * w_z * complex(v_x, v_y)
    # the component keeps sliding from 0 by 1e-12 m/s, and tabulates nothing: rounding
    assert mass * turned.real == pytest.approx(force.real, rel=1e-9)
    assert mass * turned.imag == pytest.approx(force.imag, rel=1e-9)
    assert inertia * found["yaw_rate"] == pytest.approx(moment, rel=1e-9)


def test_what_is_dragged_pulls_against_the_motion_of_its_point() -> None:
    values = {name: origin.value for name, origin in device_values("crawler", "lab").items()}
    force, place, moving, w_z = 2.0, complex(-0.21, 0.04), complex(0.08, -0.02), 0.3
    model = oracle(".lab/track_contact+towed_friction@body")
    state = {"vel_x": moving.real, "vel_y": moving.imag, "yaw_rate": w_z, "w2": 2.0, "w3": 1.0}
    law = {"body.towed_friction.place[1]": place.real, "body.towed_friction.place[2]": place.imag}
    some, none = (
        model.derivatives(state | law | {"body.towed_friction.F": f}) for f in (force, 0.0)
    )
    point = moving + 1j * w_z * place
    pull = -force * point / math.sqrt(abs(point) ** 2 + 3e-3**2)
    change = complex(some["vel_x"] - none["vel_x"], some["vel_y"] - none["vel_y"])
    # differences of accelerations of some m/s2
    assert float(values["mass"]) * change == pytest.approx(pull, rel=1e-12)
    turned = float(values["yaw_inertia"]) * (some["yaw_rate"] - none["yaw_rate"])
    assert turned == pytest.approx((place.conjugate() * pull).imag, rel=1e-12)


def test_eccentric_sprockets_carry_a_crawler_back_and_forth_over_a_turn() -> None:
    """Both alike: no turn, and x = r phi + e sin(phi) but for the slip that acceleration asks."""
    e, w, r = 5e-4, 2.0, device_values("crawler", "lab")["r"].value
    both = oracle(".lab/track_contact+wheel_runout@radius_right+wheel_runout@radius_left")
    names = ("radius_right.wheel_runout.e", "radius_left.wheel_runout.e")
    values = {"w2": w, "w3": w, "x_G": 0.0, "y_G": 0.0, "f_r": 0.0, **dict.fromkeys(names, e)}
    times = np.linspace(0.0, 2 * math.pi / w, 9)
    run = both.simulate(times, {**values, "vel_x": (r + e) * w})
    phi = w * times
    # slip speeds are u_0 a/(mu g) with accelerations a of e w^2: 4e-7 m/s
    np.testing.assert_allclose(run["x"], r * phi + e * np.sin(phi), atol=2e-6)
    assert np.ptp(run["x"] - r * phi) == pytest.approx(2 * e, rel=0.01)
    np.testing.assert_allclose(run["beta"], 0.0, atol=1e-12)
