"""Plain logs come in through a mapping: names, scales, signs, clocks, gaps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from cosim.calibrate import Problem, read_problem
from cosim.calibrate.mapping import snapped
from cosim.errors import ScenarioError

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
angle = { source = "deg", time = "t_deg", late = 5.0, scale = 0.017453292519943295 }

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
    problem = read_problem(tmp_path, workers=1)
    one = problem.run("one")
    assert one.times == pytest.approx(run.times, abs=1e-9)  # 7e4 ms in doubles
    assert one.data[:, 0] == pytest.approx(current, abs=1e-12)  # factors 1000 and back
    good = np.isfinite(one.data[:, 1])
    # 50 samples of 4 ms are lost, and what lies between their neighbours
    assert 195 < np.sum(~good) < 205
    # interpolated over 4 ms at accelerations up to 2e4 rad/s2: 4e-3^2/8 * 2e4 = 0.04 rad
    assert np.max(np.abs(one.data[good, 1] - angle[good])) < 0.04
    assert problem.channels[0].unit == "A"
    assert problem.simulate(problem.nominal, "one").shape == one.data.shape


def test_faults_of_a_mapping_are_named(tmp_path: Path) -> None:
    (tmp_path / "dataset.toml").write_text('system = "motor_bench"\nstep = 1e-3\n')
    with pytest.raises(ScenarioError, match="lists no runs"):
        read_problem(tmp_path)
    text = MAPPING.replace("SUFFIX", "npz").replace('source = "i_mA"', 'sorce = "i_mA"')
    (tmp_path / "dataset.toml").write_text(text)
    np.savez(tmp_path / "one.npz", t_ms=np.arange(100.0), cmd_rpm=np.zeros(100))
    with pytest.raises(ScenarioError, match="current: has no key 'sorce'"):
        read_problem(tmp_path)


def test_times_that_miss_the_grid_by_rounding_act_in_their_own_step() -> None:
    exact = np.arange(2000) * 1e-3
    rounded = exact.astype(np.float32).astype(np.float64)
    assert np.any(rounded > exact)  # such a set value would act one step late
    np.testing.assert_array_equal(snapped(rounded, 5e-4), exact)
    apart = exact + 2e-5  # a fiftieth of the interval is no rounding
    np.testing.assert_array_equal(snapped(apart, 5e-4), apart)
