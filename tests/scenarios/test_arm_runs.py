"""The laboratory's base with its arm: folded, it is the mass that the base alone carries."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cosim.calibrate.mapping import read_problem
from cosim.calibrate.problem import Problem
from cosim.installation import places
from tests.problems import simulator

BENCH = places.scenarios() / "mobile_manipulator_bench"
FOLDED = (3.14, -1.95, 2.25, -1.87, -1.57, 0.0)
END = 6.0


def data_set(folder: Path, swing: float) -> Path:
    """A run in a curve, with the arm folded or its first joint swinging."""
    times = np.arange(0.0, END + 0.005, 0.01)
    ramp = np.clip(times, 0.0, 1.0) - np.clip(times - 4.0, 0.0, 1.0)
    zeros = np.zeros(times.shape)
    table = {"time": times, "v_set": 0.5 * ramp, "w_set": 0.2 * ramp}
    table |= {f"q_set_{i}": zeros + angle for i, angle in enumerate(FOLDED, 1)}
    table["q_set_1"] += swing * (1.0 - np.cos(2.0 * times))
    table |= {name: zeros for name in ("base_x", "base_y", "base_phi")}
    table |= {f"wheel_speed_{side}": zeros for side in "lr"}
    table |= {f"motor_current_{side}": zeros for side in "lr"}
    table |= {f"ee_{axis}": zeros for axis in "xyz"}
    folder.mkdir()
    pd.DataFrame(table).to_csv(folder / "run.csv", index=False)
    sheet = BENCH / "data/mobile_manipulator.toml"
    (folder / "mobile_manipulator.toml").write_bytes(sheet.read_bytes())
    (folder / "set.toml").write_text(
        'rig = "mobile_manipulator"\nset = "arm"\nsheet = "mobile_manipulator.toml"\n'
        f"columns = {list(table)}\n"
        '[[run]]\nname = "A"\nfile = "run.csv"\npurpose = "identification"\n'
        f"arm_moves = {str(swing != 0.0).lower()}\n"
    )
    return folder


def simulated(problem: Problem) -> dict[str, np.ndarray]:
    """Channel -> values over the sensor's noise."""
    values = simulator(problem).simulate(problem.nominal, "A") / problem.sigma
    simulator(problem).close()
    return dict(zip((c.name for c in problem.channels), values.T, strict=True))


@pytest.mark.slow
def test_a_folded_arm_is_the_mass_that_the_base_carries(tmp_path: Path) -> None:
    folder = data_set(tmp_path / "folded", 0.0)
    alone = simulated(read_problem(folder))
    both = simulated(read_problem(folder, mapping=BENCH / "arm.toml", only={"arm_moves": False}))
    assert np.ptp(alone["base_x"]) > 1000.0
    for name, values in alone.items():
        # the servos give way by some 1e-4 rad; currents show that where the set speed has corners
        limit = 0.3 if name.startswith("motor_current") else 0.1
        assert np.sqrt(np.mean((values - both[name]) ** 2)) < limit, name


def test_a_swinging_arm_shows_on_the_base(tmp_path: Path) -> None:
    folder = data_set(tmp_path / "swings", 0.4)
    problem = read_problem(folder)
    assert problem.runs == ()
    (read,) = problem.further
    swinging = read()
    alone = simulated(
        read_problem(folder, mapping=BENCH / "dataset.toml", only={"arm_moves": True})
    )
    both = simulated(swinging)
    # 1.6 rad/s^2 on a few tenths of a kg.m2 turn the base against its drives: more than their noise
    difference = both["motor_current_l"] - alone["motor_current_l"]
    assert np.sqrt(np.mean(difference**2)) > 1.0
    assert np.ptp(both["ee_y"] - both["base_y"]) > 100.0


@pytest.mark.parametrize("axis", ["x", "y"])
def test_the_tool_is_where_the_folded_arm_holds_it(tmp_path: Path, axis: str) -> None:
    folder = data_set(tmp_path / "folded", 0.0)
    both = read_problem(folder, mapping=BENCH / "arm.toml", only={"arm_moves": False})
    found = simulated(both)
    heading = found["base_phi"] * 0.0005
    base = {a: found[f"base_{a}"] * 0.0003 for a in "xy"}
    tool = {a: found[f"ee_{a}"] * 0.0004 for a in "xy"}
    turned = {
        "x": np.cos(heading) * (tool["x"] - base["x"]) + np.sin(heading) * (tool["y"] - base["y"]),
        "y": np.cos(heading) * (tool["y"] - base["y"]) - np.sin(heading) * (tool["x"] - base["x"]),
    }
    # joints give way by less than a milliradian at an arm's length of half a metre
    assert np.ptp(turned[axis]) < 5e-4
