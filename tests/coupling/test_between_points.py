"""Step control: what is recorded inside long steps, connected or not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

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
