"""Step control: what is recorded inside long steps, connected or not; steps that are taken back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.errors import StepError
from cosim.master.master import Master
from cosim.system.system import System
from tests.tiny_fmus import V, tiny

RASTER = 1e-3


def adaptive(system: System, tolerance: float, record: list[str], end: float = 1.0):
    master = Master(system, "adaptive", RASTER, options={"tolerance": tolerance})
    return master.run(end, record=record)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4])
def test_what_feeds_nothing_is_right_between_long_steps(provider, tolerance) -> None:
    # J w' = tau - b w: towards 10 rad/s in 0.1 s, which one parabola over 0.1 s misses by 0.01
    system = System(provider=provider)
    system.add("load", "inertia/disc", {"J": 0.01, "b": 0.1, "speed": 5.0, "tau": 1.0})
    found = adaptive(system, tolerance, ["load.w"])
    exact = 10.0 - 5.0 * np.exp(-10.0 * found.time)
    assert np.abs(found["load.w"] - exact).max() < tolerance * 10.0
    assert found.provenance["step_control"]["longest_s"] > 0.05  # still long where it rests


@pytest.mark.parametrize(
    ("kind", "law"), [("Boolean", "{t} > 0.1234"), ("Int32", "(int)(0.3 + 8 * {t})")]
)
def test_what_jumps_is_recorded_when_it_jumps(tmp_path: Path, kind, law) -> None:
    # the FMU says at t what holds at t; nothing else changes
    fmu = tiny(
        tmp_path,
        [V("y", kind, "output"), V("t", "Float64", "output")],
        step=f"v->r[1][0] = t + h; v->r[0][0] = {law.format(t='(t + h)')}; return 0;",
    )
    system = System()
    system.add("clock", str(fmu))
    found = adaptive(system, 1e-4, ["clock.y", "clock.t"])
    plain = Master(system, "jacobi", RASTER).run(1.0, record=["clock.y", "clock.t"])
    np.testing.assert_array_equal(found["clock.y"], plain["clock.y"])
    control = found.provenance["step_control"]
    assert control["taken"] < 300 and control["shortest_s"] > 0.99 * RASTER


def test_what_is_faster_than_the_raster_does_not_shorten_steps_below_it(tmp_path: Path) -> None:
    law = "v->r[0][0] = __builtin_sin(1e4 * (t + h));"
    fmu = tiny(tmp_path, [V("y", "Float64", "output")], step=law)
    system = System()
    system.add("tone", str(fmu))
    found = adaptive(system, 1e-6, ["tone.y"], 0.05)
    np.testing.assert_allclose(found["tone.y"][1:], np.sin(1e4 * found.time[1:]), atol=1e-9)
    assert found.provenance["step_control"]["shortest_s"] > 0.99 * RASTER


@pytest.mark.parametrize("tolerance", [1e-4, 1e-8])
def test_what_is_connected_and_jumps_acts_when_it_jumps(tmp_path: Path, tolerance) -> None:
    # heats and cools at 1 K/s, switched by a thermostat of +-0.1 K
    room = tiny(
        tmp_path,
        [V("on", "Boolean", "input", "true"), V("T", "Float64", "output", "0")],
        step="v->r[1][0] += (v->n[0][0] ? 1.0 : -1.0) * h;",
        begin="v->n[0][0] = 1;",
        name="room",
    )
    thermostat = tiny(
        tmp_path,
        [V("T", "Float64", "input", "0"), V("on", "Boolean", "output")],
        "if (v->r[0][0] >= 0.1) v->n[1][0] = 0; if (v->r[0][0] <= -0.1) v->n[1][0] = 1;",
        begin="v->n[1][0] = 1;",
        name="thermostat",
    )
    system = System()
    system.add("room", str(room))
    system.add("thermostat", str(thermostat))
    system.connect("room.T", "thermostat.T")
    system.connect("thermostat.on", "room.on")
    found = adaptive(system, tolerance, ["room.T"])
    assert np.abs(found["room.T"]).max() < 0.1 + RASTER  # a communication step late at most


def swinging(folder: Path, beyond: str) -> System:
    """x'' = -x from x = 1: no faster than 1 m/s, unless steps are too long."""
    mass = tiny(
        folder,
        [V("f", "Float64", "input", "0"), V("x", "Float64", "output"), V("v", "Float64", "output")],
        "v->r[1][0] = v->r[3][0]; v->r[2][0] = v->r[3][1];",
        "double a = v->r[0][0]; v->r[3][0] += (v->r[3][1] + 0.5 * a * h) * h; v->r[3][1] += a * h;"
        + beyond,
        begin="v->r[3][0] = 1;",
        name="mass",
    )
    spring = tiny(
        folder,
        [V("x", "Float64", "input", "0"), V("f", "Float64", "output")],
        "v->r[1][0] = -v->r[0][0];",
        name="spring",
    )
    system = System()
    system.add("mass", str(mass))
    system.add("spring", str(spring))
    system.connect("mass.x", "spring.x")
    system.connect("spring.f", "mass.f")
    return system


FAST = "if (v->r[3][1] > 1.2 || v->r[3][1] < -1.2) "


@pytest.mark.parametrize(
    "beyond",
    [
        FAST + "{ v->end = 1; v->last = t + h; }",  # asks to end
        FAST + "return 3;",  # fails
        "if (h > 0.02) return 2;",  # discards: asks for a shorter step
    ],
)
def test_a_trial_step_that_is_too_long_neither_ends_nor_fails_the_run(tmp_path, beyond) -> None:
    master = Master(swinging(tmp_path, beyond), "adaptive", 0.1, options={"tolerance": 1e-3})
    found = master.run(6.0, record=["mass.v"])
    assert found.time[-1] == pytest.approx(6.0) and not found.notes
    assert np.abs(found["mass.v"]).max() < 1.2


@pytest.mark.parametrize("what", ["{ v->end = 1; v->last = 5.005; }", "return 3;"])
def test_ends_and_failures_that_are_real_are_recorded_up_to_the_last_point(tmp_path, what) -> None:
    system = swinging(tmp_path, f"if (t + h > 5.005) {what}")
    master = Master(system, "adaptive", 0.01, options={"tolerance": 1e-3})
    if "return" in what:
        with pytest.raises(
            StepError, match=r"stopped at t = 5 s: mass .* status 'error'"
        ) as caught:
            master.run(6.0)
        assert caught.value.recording is not None
        found = caught.value.recording
    else:
        found = master.run(6.0)
        assert "asked to end the simulation at t = 5.005 s" in found.notes[0]
    assert found.time[-1] == pytest.approx(5.0)


def test_clocks_since_1970_make_no_steps_of_rounding(tmp_path: Path) -> None:
    master = Master(swinging(tmp_path, ""), "adaptive", 1e-3, options={"tolerance": 1e-6})
    found = master.run(0.2, start=1.7e9)
    assert found.provenance["step_control"]["shortest_s"] > 0.9 * RASTER
