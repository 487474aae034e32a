"""Effects on signals and the command link against independent recursions in numpy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from cosim.data.signals import Function
from cosim.installation.builder import default_provider
from cosim.master.master import Master
from cosim.system.system import System
from sources.effect import Effect
from sources.model import ModelError
from sources.variant import build_model, effects
from tests.support import Stepper, oracle_of

pytestmark = pytest.mark.slow

KINDS = {"signal", "bundle", "pose", "point"}
SIGNAL_EFFECTS: dict[str, Effect] = {
    name: module.EFFECT
    for name, module in effects().items()
    if set(module.EFFECT.kinds) <= KINDS and not module.EFFECT.needs and not module.EFFECT.unit
}
COMPONENTS = (
    "trajectory/body",
    "inverse_kinematics/world",
    "command_link/ideal",
    "encoder/ideal",
    "current_sensor/averaging",
    "pose_sensor/motion_capture",
    "marker_sensor/camera",
)
CASES = [
    (variant, balance.name, name)
    for variant in COMPONENTS
    for balance in build_model(variant).balances.values()
    for name, effect in SIGNAL_EFFECTS.items()
    if balance.kind in effect.kinds
]


def inputs_at(stepper: Stepper, k: int) -> dict[str, float]:
    names = [v.name for v in stepper.model.of_role("input")]
    return {name: math.sin(0.1 * k + 2.0 * i) for i, name in enumerate(names)}


def test_the_list_of_cases_is_not_empty() -> None:
    assert len(SIGNAL_EFFECTS) >= 12 and len(CASES) > 100
    assert {name for _, _, name in CASES} == set(SIGNAL_EFFECTS)


@pytest.mark.parametrize("variant", COMPONENTS)
def test_strength_zero_is_exact_absence_over_a_run(variant: str) -> None:
    bare = Stepper(variant)
    expected = [bare.step(inputs_at(bare, k), 0.003) for k in range(15)]
    for _, balance, name in (case for case in CASES if case[0] == variant):
        prefix = f"{balance}.{name}"
        strength = f"{prefix}.{SIGNAL_EFFECTS[name].strength.name}"
        stepper = Stepper(f"{variant}+{name}@{balance}", {strength: 0.0})
        for k in range(15):
            outputs = stepper.step(inputs_at(stepper, k), 0.003)
            assert {key: outputs[key] for key in expected[k]} == expected[k], (balance, name)


@pytest.mark.parametrize("variant", COMPONENTS)
def test_every_effect_does_something_and_stays_finite(variant: str) -> None:
    bare = Stepper(variant)
    expected = [list(bare.step(inputs_at(bare, k), 0.003).values()) for k in range(15)]
    for _, balance, name in (case for case in CASES if case[0] == variant):
        model = build_model(f"{variant}+{name}@{balance}")
        # In 45 ms a clock loses more than one communication step only at its greatest skew.
        fast = {f"{balance}.clock_skew.skew": 0.1} if name == "clock_skew" else {}
        stepper = Stepper(model, fast)
        read = [list(stepper.step(inputs_at(stepper, k), 0.003).values()) for k in range(15)]
        assert np.all(np.isfinite(read)), (balance, name)
        assert read != expected, (balance, name)
        oracle = stepper.oracle
        jacobian = oracle.functions.jacobian(*oracle.arguments())[1]
        assert np.all(np.isfinite(np.asarray(jacobian))), (balance, name)


def command(variant: str, values: dict[str, float], signal: np.ndarray, dt: float) -> np.ndarray:
    """v_d of a command link at the beginning of each step, with that step's command set."""
    stepper = Stepper(f"command_link/{variant}", values)
    read = []
    for value in signal:
        stepper.set({"v_set": float(value)})
        read.append(stepper.outputs()["v_d"])
        stepper.step({}, dt)
    return np.array(read)


def smooth(dt: float, count: int) -> np.ndarray:
    t = np.arange(count) * dt
    return np.sin(3.0 * t) + 0.4 * np.cos(17.0 * t)


@pytest.mark.parametrize("variant", ["delayed", "ideal+delay"])
@pytest.mark.parametrize("steps", [1, 7, 61])
def test_delay_by_whole_samples_is_the_shifted_signal(variant: str, steps: int) -> None:
    dt = 0.002
    signal = smooth(dt, 150)
    prefix = "delay." if "+" in variant else ""
    values = {f"{prefix}t_d": steps * dt, f"{prefix}period": dt}
    read = command(variant, values, signal, dt)
    # Interpolation weights differ from 0 and 1 by the rounding of k * dt only.
    assert read[steps:] == pytest.approx(signal[: 150 - steps], abs=1e-12)
    assert read[:steps] == pytest.approx(np.full(steps, signal[0]), abs=1e-12)


@pytest.mark.parametrize("t_d", [0.0007, 0.0013, 0.0291])
def test_delay_by_fractions_interpolates_linearly(t_d: float) -> None:
    dt, count = 0.001, 200
    signal = smooth(dt, count)
    read = command("ideal+delay", {"delay.t_d": t_d, "delay.period": dt}, signal, dt)
    t = np.arange(count) * dt
    expected = np.interp(t - t_d, t, signal)
    assert read == pytest.approx(expected, abs=1e-12)  # rounding of k * dt
    exact = np.sin(3.0 * (t - t_d)) + 0.4 * np.cos(17.0 * (t - t_d))
    # Error of linear interpolation: dt^2 / 8 times the greatest curvature.
    late = t > t_d
    assert np.abs(read - exact)[late].max() < dt**2 / 8 * (9.0 + 0.4 * 17**2) * 1.001


def test_a_delay_longer_than_the_grid_stretches_the_grid() -> None:
    dt, count, t_d = 0.01, 200, 0.8
    signal = smooth(dt, count)
    read = command("ideal+delay", {"delay.t_d": t_d}, signal, dt)
    t = np.arange(count) * dt
    exact = np.sin(3.0 * (t - t_d)) + 0.4 * np.cos(17.0 * (t - t_d))
    # The command is held over dt and sampled every t_d / 62: late by up to dt and interpolated.
    late = t > t_d + 0.05
    assert np.abs(read - exact)[late].max() < (dt + t_d / 62) * (3.0 + 0.4 * 17.0)
    assert np.abs(read - signal)[late].max() > 0.5


def test_clock_skew_loses_time_in_proportion() -> None:
    dt, skew = 0.01, 0.02
    t = np.arange(300) * dt
    read = command("ideal+clock_skew", {"clock_skew.skew": skew}, t, dt)
    # A ramp tells the time; its interpolation is exact but for the hold over a step of dt, which
    # is seen as soon as the lost time falls between the samples of one step.
    assert np.abs(read - (1 - skew) * t).max() < dt
    assert read[-1] == pytest.approx((1 - skew) * t[-1], abs=dt)
    assert t[-1] - read[-1] > 0.8 * skew * t[-1]


def test_a_zero_drifts_from_the_start_of_a_run_on() -> None:
    stepper = Stepper("current_sensor/ideal+zero_drift", {"zero_drift.rate": 0.2})
    read = [stepper.step({"i": 3.0}, 0.5)["i_meas"] for _ in range(4)]
    assert read == pytest.approx([3.1, 3.2, 3.3, 3.4], rel=1e-14)  # a constant is integrated


@pytest.mark.parametrize(
    ("variant", "unit"), [("pose_sensor/ideal", "m/s"), ("adapter/signal", "any")]
)
def test_a_drift_has_the_unit_of_its_signal_per_second(variant: str, unit: str) -> None:
    model = build_model(f"{variant}+zero_drift")
    (rate,) = [v for v in model.of_role("parameter") if v.name.endswith("zero_drift.rate")]
    assert rate.quantity.unit == unit


def test_held_commands_equal_the_sample_and_hold_effect() -> None:
    signal = smooth(0.001, 100)
    link = command("held", {"T": 0.01}, signal, 0.001)
    effect = command("ideal+sample_hold", {"sample_hold.t_s": 0.01}, signal, 0.001)
    # What stands there at t is the sample before t: the tick at t has not acted yet.
    previous = signal[np.maximum(0, (np.arange(100) - 1) // 10 * 10)]
    assert link == pytest.approx(previous, abs=0) and effect == pytest.approx(previous, abs=1e-15)


def test_first_order_lag_follows_the_exponential_and_starts_settled() -> None:
    stepper = Stepper(
        "current_sensor/ideal+first_order_lag", {"first_order_lag.t_lag": 0.02}, max_step=1e-4
    )
    assert stepper.step({"i": 3.0}, 0.01)["i_meas"] == 3.0
    read = [stepper.step({"i": 5.0}, 0.01)["i_meas"] for _ in range(5)]
    expected = [5.0 - 2.0 * math.exp(-0.01 * (k + 1) / 0.02) for k in range(5)]
    assert read == pytest.approx(expected, rel=1e-11)  # RK4 with 200 steps per time constant


def test_a_lag_starts_settled_whenever_the_run_begins() -> None:
    def read(start: float) -> Any:
        system = System("lag", default_provider())
        system.add("a", "adapter/signal+first_order_lag")
        master = Master(system, "jacobi", 1e-3)
        signal = Function(lambda t: np.cos(20.0 * (t - start)))
        return master.run(1.0, inputs={"a.u": signal}, record=["a.y"], start=start)["a.y"]

    assert read(0.37) == pytest.approx(read(0.0), abs=1e-12)
    assert read(-0.2) == pytest.approx(read(0.0), abs=1e-12)


@pytest.mark.parametrize("variant", ["diff_drive/rolling", "mecanum_wheels/rolling"])
@pytest.mark.parametrize("t_lag", [0.04, 0.02, 0.007, 0.002])
def test_a_lag_shorter_than_the_solvers_step_is_right(variant: str, t_lag: float) -> None:
    """Runge-Kutta runs away where it is a 2.8th of the step, and is far off at half of it."""
    system = System("lag", default_provider())
    system.add("a", f"{variant}+first_order_lag")
    strengths = [n for n in system.members["a"].description.variables if n.endswith(".t_lag")]
    for name in strengths:
        system.set(f"a.{name}", t_lag)
    inputs = {name: 1.0 for name in system.open_inputs()}
    steps = {}
    for step in (0.02, 1e-4):
        system.set("a.solver.step", step)
        steps[step] = Master(system, "jacobi", 0.02).run(0.4, inputs=inputs)
    for name in steps[0.02].names:
        fine = steps[1e-4][name]
        assert steps[0.02][name] == pytest.approx(fine, rel=1e-3, abs=1e-3 * np.ptp(fine) + 1e-9)


def test_rate_limit_is_the_digital_acceleration_limiter() -> None:
    rate, t_s = 3.0, 0.0005
    rng = np.random.default_rng(2)
    signal = np.repeat(rng.uniform(-1, 1, 12), 40)
    values = {"speed.rate_limit.slowness": 1 / rate, "speed.rate_limit.t_s": t_s}
    stepper = Stepper("trajectory/external+rate_limit@speed", values)
    read = [stepper.step({"v_set": float(v)}, t_s)["v_d"] for v in signal]
    expected, z = [], signal[0]
    for v in signal:
        z += max(-rate * t_s, min(rate * t_s, v - z))
        expected.append(z)
    assert read == pytest.approx(expected, abs=1e-13)  # sums of 480 terms
    assert (
        build_model("trajectory/external+rate_limit").variables["rate_limit.slowness"].quantity.unit
        == "s2.m-1"
    )


def outputs(variant: str, values: dict[str, float]) -> dict[str, float]:
    return oracle_of(variant).outputs(values)


def test_static_effects_follow_their_formulas() -> None:
    for i in (-1.0, -0.013, 0.0, 0.004, 0.7):
        gain = outputs("current_sensor/ideal+gain", {"gain.error": 0.03, "i": i})
        assert gain["i_meas"] == pytest.approx(1.03 * i, rel=1e-15)
        bias = outputs("current_sensor/ideal+bias", {"bias.bias": 0.2, "i": i})
        assert bias["i_meas"] == pytest.approx(i + 0.2, rel=1e-15)
        dead = outputs("trajectory/external+command_dead_zone", {"v_set": i})
        assert dead["v_d"] == pytest.approx(math.copysign(max(0.0, abs(i) - 0.02), i), abs=1e-17)
        step = {"quantization.step": 0.01, "i": i}
        rounded = outputs("current_sensor/ideal+quantization", step)["i_meas"]
        assert rounded == pytest.approx(round(i, 2), abs=1e-15)


def test_effects_take_the_unit_of_their_balance() -> None:
    variables = build_model("current_sensor/ideal+bias").variables
    assert variables["bias.bias"].quantity.unit == "A"
    assert build_model("trajectory/body+bias").variables["bias.bias"].quantity.unit == "m/s"


def test_share_selects_an_element_of_a_vector() -> None:
    values = {"v_d": 1.0, "w_d": 0.0, "command.gain.error": 0.1, "command.gain.share[1]": 0.0}
    out = outputs("inverse_kinematics/body+gain@command", values)
    assert out["w_l_ref"] == pytest.approx(101.67, rel=1e-14)
    assert out["w_r_ref"] == pytest.approx(1.1 * 101.67, rel=1e-14)


@pytest.mark.parametrize("k", [2e-3, -5e-3])
def test_a_lens_moves_markers_along_their_rays(k: float) -> None:
    """With the square of how far they are from the axis; the axis itself stands."""
    at = {"x": 2.0, "y": 1.0, "phi": 0.5}
    lens = {"lens_distortion.k": k, "lens_distortion.centre[1]": 0.4,
            "lens_distortion.centre[2]": -0.3}  # fmt: skip
    plain = outputs("marker_sensor/ideal", at)
    found = outputs("marker_sensor/ideal+lens_distortion", at | lens)
    seen = outputs("pose_sensor/ideal+lens_distortion@position", at | {
        name.replace("lens", "position.lens"): value for name, value in lens.items()
    })  # fmt: skip
    pairs = [(plain, found, f"x_m[{i}]", f"y_m[{i}]") for i in range(1, 6)]
    pairs.append((outputs("pose_sensor/ideal", at), seen, "x_meas", "y_meas"))
    for before, after, x, y in pairs:
        ray = complex(before[x], before[y]) - (0.4 - 0.3j)
        moved = complex(after[x], after[y]) - (0.4 - 0.3j)
        # some ten operations of 1e-16 on metres
        assert moved == pytest.approx(ray * (1.0 + k * abs(ray) ** 2), rel=1e-13)


def test_scale_error_stretches_way_and_body() -> None:
    """All distances between measured points grow alike, from the frame's origin on."""
    values = {"x": 2.0, "y": 1.0, "phi": 0.5, "scale_error.error": 0.01}
    plain = outputs("marker_sensor/ideal", {k: values[k] for k in ("x", "y", "phi")})
    out = outputs("marker_sensor/ideal+scale_error", values)
    for name in (f"{axis}_m[{k}]" for axis in "xy" for k in range(1, 6)):
        assert out[name] == pytest.approx(1.01 * plain[name], rel=1e-14)  # rounding


def test_frame_rotation_turns_position_and_heading() -> None:
    values = {"x": 2.0, "y": 1.0, "phi": 0.5, "frame_rotation.angle": math.pi / 2}
    out = outputs("pose_sensor/ideal+frame_rotation", values)
    read = [out[name] for name in ("x_meas", "y_meas", "phi_meas")]
    assert read == pytest.approx([-1.0, 2.0, 0.5 + math.pi / 2], abs=1e-15)
    values["position.frame_rotation.angle"] = values.pop("frame_rotation.angle")
    assert outputs("pose_sensor/ideal+frame_rotation@position", values)["phi_meas"] == 0.5


def test_marker_offset_turns_with_the_body() -> None:
    values = {"marker_offset.distance": 0.1, "marker_offset.direction": math.pi / 2}
    for phi in (0.0, 1.0, -2.5):
        out = outputs("pose_sensor/ideal+marker_offset", {**values, "phi": phi})
        assert out["x_meas"] == pytest.approx(-0.1 * math.sin(phi), abs=1e-16)
        assert out["y_meas"] == pytest.approx(0.1 * math.cos(phi), abs=1e-16)
        assert out["phi_meas"] == phi


def test_an_effect_on_the_wrong_balance_is_refused_by_name() -> None:
    with pytest.raises(ModelError, match="'frame_rotation' cannot act on balance 'yaw'"):
        build_model("pose_sensor/ideal+frame_rotation@yaw")
    with pytest.raises(ModelError, match=r"frame_rotation.*fits no balance of encoder/ideal"):
        build_model("encoder/ideal+frame_rotation")


def test_speed_effect_on_a_link_reaches_the_world_speeds() -> None:
    values = {"v_set": 0.5, "phi_set": 0.8, "xd_set": 0.5 * math.cos(0.8)}
    values |= {"yd_set": 0.5 * math.sin(0.8), "speed.gain.error": 0.1}
    out = outputs("command_link/ideal+gain@speed", values)
    assert math.hypot(out["xd_d"], out["yd_d"]) == pytest.approx(out["v_d"], rel=1e-15)
    assert out["v_d"] == pytest.approx(0.55, rel=1e-15)
