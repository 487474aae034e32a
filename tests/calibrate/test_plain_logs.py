"""Plain logs come in through a mapping: names, scales, signs, clocks, gaps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from cosim.calibrate import Problem, read_problem
from cosim.calibrate.joining import snapped
from cosim.errors import ScenarioError
from tests.problems import simulator

MAPPING = """
system = "motor_bench"
step = 5e-5
algorithm = "gauss_seidel"
time = "t_ms"

[parameters]
"encoder.n" = 1e9

[columns]
time = { source = "t_ms", scale = 1e-3 }
speed_set = { source = "cmd_rpm", scale = 0.10471975511965977, unit = "rad/s" }
current = { source = "i_mA", scale = -1e-3, unit = "A" }
angle = { source = "deg", time = "t_deg", late = 5e-3, scale = 0.017453292519943295 }

[[parameter]]
name = "K_t"
unit = "N.m/A"
nominal = 0.095
min = 0.09
max = 0.1
targets = "motor.K_t"

[inputs]
"motor.w_ref" = "speed_set"

[channels]
current = { signal = "motor.i_measured", sigma = 0.05 }
angle = { signal = "encoder.theta", sigma = 0.005 }

[[run]]
name = "one"
file = "one.SUFFIX"
purpose = "identification"
"""


@pytest.mark.parametrize("suffix", ["npz", "mat"])
def test_other_clocks_scales_and_signs(
    tmp_path: Path, short: Problem, exact: dict[str, np.ndarray], suffix: str
) -> None:
    run = short.run("sines")
    command = np.asarray(run.inputs["motor.w_ref"].at(run.times))
    current, angle = exact["sines"][:, 1], exact["sines"][:, 3]
    slow = slice(0, None, 4)
    gap = np.ones(run.times[slow].size, dtype=bool)
    gap[100:150] = False
    content = {
        "t_ms": 7e4 + 1e3 * run.times,
        "cmd_rpm": command * 30 / np.pi,
        "i_mA": -1e3 * current,
        "t_deg": (7e4 + 1e3 * run.times[slow] + 5.0)[gap],
        "deg": np.degrees(angle[slow])[gap],
    }
    if suffix == "npz":
        np.savez(tmp_path / "one.npz", **content)
    else:
        savemat(tmp_path / "one.mat", content)
    (tmp_path / "dataset.toml").write_text(MAPPING.replace("SUFFIX", suffix))
    problem = read_problem(tmp_path)
    one = problem.run("one")
    assert one.times == pytest.approx(run.times, abs=1e-9)  # 7e4 ms in doubles
    assert one.data[:, 0] == pytest.approx(current, abs=1e-12)  # factors 1000 and back
    good = np.isfinite(one.data[:, 1])
    # 50 samples of 4 ms are lost, and what lies between their neighbours
    assert 195 < np.sum(~good) < 205
    # interpolated over 4 ms at accelerations up to 2e4 rad/s2: 4e-3^2/8 * 2e4 = 0.04 rad
    assert np.max(np.abs(one.data[good, 1] - angle[good])) < 0.04
    assert problem.channels[0].unit == "A"
    assert simulator(problem).simulate(problem.nominal, "one").shape == one.data.shape


def test_faults_of_a_mapping_are_named(tmp_path: Path) -> None:
    text = 'system = "motor_bench"\nstep = 1e-3\n'
    (tmp_path / "dataset.toml").write_text(text)
    with pytest.raises(ScenarioError, match="lacks 'channels'; there is system, step"):
        read_problem(tmp_path)
    (tmp_path / "dataset.toml").write_text(text + '[channels.w]\nsignal = "load.w"\n')
    with pytest.raises(ScenarioError, match="lists no runs"):
        read_problem(tmp_path)
    text = MAPPING.replace("SUFFIX", "npz").replace('source = "i_mA"', 'sorce = "i_mA"')
    (tmp_path / "dataset.toml").write_text(text)
    np.savez(tmp_path / "one.npz", t_ms=np.arange(100.0), cmd_rpm=np.zeros(100))
    with pytest.raises(ScenarioError, match="current: has no key 'sorce'"):
        read_problem(tmp_path)


def arm_log(folder: Path, samples: str = "", lowpass: float = 5.0) -> Path:
    """Six joints as tables with one row per sample, and a mapping that filters them."""
    times = np.arange(800) * 0.01
    angles = np.sin(2.0 * times)[:, None] * np.arange(1, 7)
    np.savez(folder / "one.npz", t=times, q=angles, qd=2.0 * np.cos(2.0 * times)[:, None]
             * np.arange(1, 7), i=angles)  # fmt: skip
    text = f"""
system = "system.toml"
step = 1e-2
time = "t"
[columns]
"a_1..6" = {{ source = "qd_{{}}", lowpass = {lowpass}, derivative = true }}
[inputs]
"arm.qdd" = {{ columns = "a_1..6", interpolation = "linear" }}
[channels]
"i_1..6" = {{ signal = "arm.i[{{}}]", sigma = 0.1, unit = "A" }}
[[parameter]]
name = "F_v"
nominal = 1.0
min = 0.0
max = 2.0
targets = "arm.F_v[1]"
[[run]]
name = "one"
file = "one.npz"
purpose = "identification"
{samples}
"""
    (folder / "dataset.toml").write_text(text)
    (folder / "system.toml").write_text(
        'description = "Arm."\nconnections = []\n[instances]\narm = "moved_arm/rigid"\n'
    )
    return folder


def test_tables_filters_and_parts_of_a_log(tmp_path: Path) -> None:
    run = read_problem(arm_log(tmp_path, "samples = [101, 700]")).run("one")
    times = np.arange(100, 700) * 0.01
    assert run.times[0] == 0.0
    assert run.data.shape == (600, 6)
    np.testing.assert_array_equal(run.data[:, 2], 3.0 * np.sin(2.0 * times))
    exact = -4.0 * 3.0 * np.sin(2.0 * times)
    found = np.asarray(run.inputs["arm.qdd[3]"].at(run.times))
    # 0.3 Hz through 5 Hz of fifth order twice passes to 1e-6; the difference quotient errs by
    # (w h)^2 / 6 = 7e-5 of 12 rad/s2
    np.testing.assert_allclose(found, exact, rtol=0, atol=12 * 1e-4)


def test_wrong_filters_and_parts_are_named(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="low-pass of 60 is above half the sample rate"):
        read_problem(arm_log(tmp_path, lowpass=60.0))
    with pytest.raises(ScenarioError, match="has 800 samples, none from 900 to 950"):
        read_problem(arm_log(tmp_path, "samples = [900, 950]"))


def test_times_that_miss_the_grid_by_rounding_act_in_their_own_step() -> None:
    exact = np.arange(2000) * 1e-3
    rounded = exact.astype(np.float32).astype(np.float64)
    assert np.any(rounded > exact)  # such a set value would act one step late
    np.testing.assert_array_equal(snapped(rounded, 5e-4), exact)
    apart = exact + 2e-5  # a fiftieth of the interval is no rounding
    np.testing.assert_array_equal(snapped(apart, 5e-4), apart)
