"""Linear systems from FMUs, margins of loops, tuning of controllers."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import control
import numpy as np
import pytest
from typer.testing import CliRunner

from cosim.cli.app import app
from cosim.control.linearize import (
    RASTER,
    connect,
    linearize,
    loop_margins,
    margins,
    operating_point,
    require_control,
    tune_pi,
    tune_pid,
)
from cosim.errors import InputError, UnknownNameError, ValueRangeError
from cosim.master.master import Master
from cosim.running.runner import prepare
from cosim.scenario.scenario import find
from cosim.system.system import System

S = control.tf("s")


def test_a_damped_load_has_its_pole(provider) -> None:
    system = System(provider=provider)
    system.add("load", "inertia/disc", {"J": 2.0, "b": 0.0})
    system.add("brake", "gearbox/ratio", {"ratio": 1.0, "b": 3.0, "J_a": 0.5, "eta": 1.0})
    for source, target in [("brake.tau_b", "load.tau"), ("load.w", "brake.w_b"),
                           ("brake.J_b", "load.J_added")]:  # fmt: skip
        system.connect(source, target)
    found = linearize(Master(system, step=0.1), 0.2, {"brake.tau_a": 0.0})
    assert found.time == pytest.approx(0.2)
    # (J + J_a) w' = tau_a - b w, exact derivatives
    np.testing.assert_allclose(np.sort(found.poles.real), [-3.0 / 2.5, 0.0], atol=1e-12)
    there = found.response(np.array([0.7]), "brake.tau_a", "load.w")
    assert there[0] == pytest.approx(1.0 / (2.5 * 2j * np.pi * 0.7 + 3.0), rel=1e-12)
    model = found.to_control(["brake.tau_a"], ["load.w"])
    assert complex(model(2j * np.pi * 0.7)) == pytest.approx(there[0], rel=1e-12)
    with pytest.raises(UnknownNameError, match=r"load\.w"):
        found.response(np.array([1.0]), "brake.tau_a", "load.v")


def test_loops_of_direct_feedthrough_are_closed_and_foreign_fmus_count_as_static(affine) -> None:
    system = System("ring")
    system.add("a", str(affine), {"a": 0.5, "b": 1.0})
    system.add("b", str(affine), {"a": -0.8})
    system.connect("a.y", "b.u")
    system.connect("b.y", "a.u", offset=1.0)
    parts, notes = operating_point(Master(system, step=0.1), 0.0, {})
    assert any("counts as static" in note for note in notes)
    (loop,) = [m for m in loop_margins(Master(system, step=0.1), parts, ["b.u"])]
    # differences of an affine law, exact up to rounding over the increment
    np.testing.assert_allclose(loop.response, 0.4, atol=1e-8)


def test_margins_of_a_known_loop() -> None:
    # L = 2 / (s (s + 1)^2): |L| = 1 at w = 1 with phase -180 degrees: no margin left
    s = 2j * np.pi * RASTER
    edge = margins("edge", RASTER, 2.0 / (s * (s + 1.0) ** 2))
    assert 2.0 * np.pi * edge.crossover == pytest.approx(1.0, rel=1e-4)  # raster of 0.23 %
    assert edge.phase == pytest.approx(0.0, abs=0.05)
    half = margins("half", RASTER, 1.0 / (s * (s + 1.0) ** 2))
    assert half.gain == pytest.approx(2.0, rel=1e-5)  # interpolated: the raster's step squared
    gm, pm, *_ = control.margin(1 / (S * (S + 1) ** 2))
    assert half.phase == pytest.approx(pm, abs=0.05) and gm == pytest.approx(2.0, rel=1e-6)


@pytest.mark.parametrize(
    ("loop", "exact"),
    [
        (2.0 / (S * (S + 1.0) * (0.1 * S + 1.0)), 5.5),
        (50.0 / (S * (S + 1.0) * (0.1 * S + 1.0)), 0.22),  # unstable: the gain must fall
        (1000.0 * (S + 1.0) ** 2 / (S**3 * (0.001 * S + 1.0) ** 2), None),  # stable between two
        (0.5 / (0.01 * S + 1.0) ** 3, 16.0),  # never above 1
        (10.0 * (S + 1.0) / S**2, np.inf),  # its phase tends to -180 degrees from above
    ],
)
def test_gain_margins_are_those_of_python_control(loop, exact: float | None) -> None:
    found = margins("loop", RASTER, loop(2j * np.pi * RASTER)).gain
    expected = float(control.margin(loop)[0])
    if exact is not None:
        assert expected == pytest.approx(exact, rel=1e-6)
    assert found == pytest.approx(expected, rel=1e-5)  # interpolated: the raster's step squared


R, L, KT, J = 0.10, 0.2e-3, 0.13, 0.00601  # motor of the MiR250 and inertia of a translation
DELAY = 150e-6


def test_nested_loops_of_the_drive_have_the_margins_of_their_design() -> None:
    winding = 1 / (L * S + R)
    inner = 0.19 + 94 / S
    s = 2j * np.pi * RASTER
    current = margins("i", RASTER, (inner * winding)(s) * np.exp(-s * DELAY))
    # design figure; it is proportional to Kp, which is printed as 0.19 (+- 2.6 %)
    assert current.crossover == pytest.approx(152, rel=0.026)
    _, phase, _, crossover = control.margin(inner * winding)  # without the delay
    assert 2 * np.pi * current.crossover == pytest.approx(crossover, rel=1e-5)
    behind = np.degrees(crossover * DELAY)
    assert current.phase == pytest.approx(phase - behind, abs=1e-3)  # interpolated on the raster
    assert current.phase == pytest.approx(82, abs=1.0)  # printed to 1 degree
    assert current.gain == pytest.approx(11, abs=0.5)  # printed to 1
    # the tuner gives back the gains of the design from its crossover and margin
    kp, ki = tune_pi(winding, current.crossover, current.phase, DELAY)
    assert kp == pytest.approx(0.19, rel=1e-3) and ki == pytest.approx(94, rel=0.02)

    closed = control.feedback(inner * winding, 1)
    plant = closed * KT / (J * S)
    speed = margins("w", RASTER, ((1.6 + 8.4 / S) * plant)(s) * np.exp(-s * DELAY))
    assert speed.crossover == pytest.approx(4.9, abs=0.75)  # theirs has friction and back-EMF
    kp, ki = tune_pi(plant, speed.crossover, speed.phase, DELAY)
    assert kp == pytest.approx(1.6, rel=1e-3) and ki == pytest.approx(8.4, rel=0.02)


@pytest.mark.parametrize(("load", "crossover", "margin"), [(0.5, 6.3, 83), (4.5, 5.3, 58)])
def test_position_loop_of_a_joint(load: float, crossover: float, margin: float) -> None:
    n, kt, eta, resistance, inductance, friction = 101, 0.12, 0.80, 0.5, 0.6e-3, 8.0
    inertia = load + n**2 * 1e-4
    torque = n * eta * kt / ((inductance * S + resistance) * (inertia * S + friction))
    plant = control.feedback(torque, kt * n) / S
    filter_time = 1 / (2 * np.pi * 400)
    law = 500 + 400 / S + 2 * S / (1 + filter_time * S)
    s = 2j * np.pi * RASTER
    found = margins("q", RASTER, (law * plant)(s) * np.exp(-s * 1e-3))
    # design figures of a plant whose friction and gains are printed to one digit
    assert found.crossover == pytest.approx(crossover, rel=0.02)
    assert found.phase == pytest.approx(margin, abs=2.0)
    _, phase, _, there = control.margin(law * plant)  # without the delay
    assert 2 * np.pi * found.crossover == pytest.approx(there, rel=1e-5)
    # interpolated on the raster
    assert found.phase == pytest.approx(phase - np.degrees(there * 1e-3), abs=1e-3)
    gains = tune_pid(plant, found.crossover, found.phase, 500 / 400, filter_time, 1e-3)
    np.testing.assert_allclose(gains, [500, 400, 2], rtol=0.02)  # raster of the margins


def test_impossible_wishes_of_the_tuner_are_refused() -> None:
    with pytest.raises(InputError, match="lower the crossover"):
        tune_pi(1 / (S * (S + 1) ** 2), 3.0, 60.0)
    with pytest.raises(InputError, match="take a PI controller"):
        tune_pid(1 / (0.2e-3 * S + 0.1), 150.0, 60.0, 1.0)


def test_without_python_control_the_extra_is_named(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(InputError, match=r"pip install 'cosim-robotics\[control\]'"):
        require_control()


@pytest.mark.slow
def test_the_command_prints_poles_and_loops(provider, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr("cosim.installation.builder.default_provider", lambda: provider)
    arguments = ["linearize", "mir250", "--at", "0.1", "--cut", "motor_left.w", "--json",
                 "--out", str(tmp_path)]  # fmt: skip
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    content = json.loads(result.stdout)
    heave = min(content["poles"], key=lambda pole: abs(pole["frequency_Hz"] - 11.3))
    # six contact springs of 1e5 N/m and dampers of 1500 N s/m under 118.6 kg: 11.3 Hz, 0.53
    assert heave["frequency_Hz"] == pytest.approx(11.3, abs=0.05)
    assert heave["damping"] == pytest.approx(0.53, abs=0.01)
    assert content["loops"][0]["phase_margin_deg"] > 45.0  # a loop that is stable with room
    assert (tmp_path / "bode.png").stat().st_size > 10_000 and (tmp_path / "linear.json").is_file()


def linear(provider, monkeypatch, *arguments: str) -> dict:
    monkeypatch.setattr("cosim.installation.builder.default_provider", lambda: provider)
    result = CliRunner().invoke(app, ["linearize", *arguments, "--json"])
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def test_the_command_takes_variants_parameters_and_algorithms(provider, monkeypatch) -> None:
    bench = ("motor_bench", "--set", "motor=electrical", "--at", "0.01")
    usual = linear(provider, monkeypatch, *bench)
    elastic = linear(provider, monkeypatch, *bench, "--set", "gearbox=elastic")
    assert set(elastic["states"]) - set(usual["states"]) == {"gearbox.twist", "gearbox.rotor_speed"}
    heavy = linear(provider, monkeypatch, *bench, "--param", "load.J=0.9")
    assert heavy["poles"] != usual["poles"]
    with pytest.raises(UnknownNameError, match="there is no algorithm 'jacobbi'"):
        linear(provider, monkeypatch, *bench, "--algorithm", "jacobbi")
    followed = linear(
        provider, monkeypatch, *bench, "--algorithm", "gauss_seidel", "--option", "extrapolation=1"
    )
    assert len(followed["poles"]) == len(usual["poles"])
    with pytest.raises(InputError, match=r"--param load: write --param INSTANCE.NAME=VALUE"):
        linear(provider, monkeypatch, *bench, "--param", "load")


def test_the_operating_point_is_on_the_clock_of_the_scenario(
    provider, tmp_path: Path, monkeypatch
) -> None:
    def at(start: float, *arguments: str) -> dict:
        path = tmp_path / f"from_{start:g}.toml"
        path.write_text(
            f"""
system = "motor_bench"
start = {start}
duration = 1.0
step = 1e-3
variants.load = "+coulomb"
[parameters]
load.coulomb.tau_c = 0.3
load.coulomb.w_0 = 1.0
load.speed = 3.0
[inputs]
"motor.w_ref" = {{ times = [{start}, {start + 0.5}], values = [5.0, 30.0], unit = "rad/s" }}
"""
        )
        return linear(provider, monkeypatch, str(path), *arguments)

    def poles(found: dict) -> np.ndarray:
        return np.array([[p["real_1_per_s"], p["imag_rad_per_s"]] for p in found["poles"]])

    assert at(10.0)["time_s"] == 10.0
    for early, late in ((at(0.0), at(10.0)), (at(0.0, "--at", "0.02"), at(10.0, "--at", "10.02"))):
        # steps at 10 s are rounded differently, and poles at -2/T are many
        np.testing.assert_allclose(poles(late), poles(early), rtol=1e-6, atol=1e-6)
    assert not np.allclose(poles(at(0.0)), poles(at(0.0, "--at", "0.02")), rtol=1e-3)
    for time in ("0", "9.999", "nan", "inf"):
        with pytest.raises(ValueRangeError, match=r"the run begins at 10 s"):
            at(10.0, "--at", time)


def loop_of_speed(provider, motor: str):
    item = find("motor_bench")[0].scenario("ST1")
    master = prepare(item, provider, variants={"motor": motor}).master
    parts, notes = operating_point(master, 1.0, item.inputs)
    (loop,) = loop_margins(master, parts, ["motor.w"])
    return connect(master, parts, notes), loop


def test_sampled_loops_are_closed_with_the_delay_of_their_samples(provider) -> None:
    sampled, loop = loop_of_speed(provider, "sampled")
    smooth, other = loop_of_speed(provider, "electrical")
    assert any("motor: linearized through its samples, every 0.0005 s" in n for n in sampled.notes)
    assert loop.crossover == pytest.approx(other.crossover, rel=5e-3)
    # the speed loop holds its value for T = 0.5 ms, T/2 on the average; the current loop is quicker
    delay = 360.0 * other.crossover * 0.5 * 5e-4
    assert other.phase - loop.phase == pytest.approx(delay, abs=0.2)

    def ringing(found):
        return next(p for p in found.poles if p.imag > 1.0)

    assert ringing(sampled) == pytest.approx(ringing(smooth), rel=1e-2)
    assert np.isfinite(loop.gain)  # with a delay there is an end to the gain


def test_a_rounded_output_of_a_sampled_sensor_is_named(provider) -> None:
    found, _ = loop_of_speed(provider, "sampled")
    assert any(n.startswith("encoder: w_meas does not change with anything") for n in found.notes)


def test_one_sampled_fmu_is_its_difference_equation(provider) -> None:
    """A held signal passes slow signals with the delay of half its period."""
    system = System("held", provider)
    system.add("link", "command_link/held")
    found = linearize(Master(system, step=1e-3), at=0.05)  # 0 before the first tick
    period = float(system.members["link"].description.variables["T"].start[0])
    slow = np.array([0.01 / period])
    answer = found.response(slow, "link.v_set", "link.v_d")[0]
    assert abs(answer) == pytest.approx(1.0, rel=1e-3)
    assert np.angle(answer) == pytest.approx(-np.pi * slow[0] * period, rel=0.02)
