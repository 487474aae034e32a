"""Gain and bias of a column that a recorder makes, declared and estimated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate import Problem, read_problem
from cosim.calibrate.fit import fit
from cosim.calibrate.parts import Channel, Sampler
from cosim.calibrate.simulator import Simulator
from cosim.errors import UnitError, UnknownNameError
from cosim.intake.example import drive, write_csv
from tests.robot_logs import ROBOT, START, YAW_GAIN, write_system

MAPPING = f"""{ROBOT}[[run]]
name = "one"
files = {{ cmd = "one_cmd.csv", pose = "one_pose.csv" }}
purpose = "identification"
"""
BIAS = """
[[nuisance]]
name = "zero"
unit = "deg"
nominal = 0.0
min = -20.0
max = 20.0
targets = "column:bias:yaw"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("recorder")
    write_csv(drive(7), "one", made)
    write_system(made)
    return made


def problem(folder: Path, more: str) -> Problem:
    (folder / "dataset.toml").write_text(MAPPING + more)
    return read_problem(folder)


def test_a_channel_reads_its_gain_and_bias_and_no_other_ones() -> None:
    channel = Channel("x", "m", 0.01, "base.x", gain=2.0, offset=0.5)
    times = np.linspace(0.0, 1.0, 5)
    sampler = Sampler(times, times)
    errors = {"gain:x": 0.1, "bias:x": -0.25, "gain:y": 9.0, "bias:y": 9.0}
    read = channel.of(sampler, times, errors)
    assert read == pytest.approx(2.0 * 1.1 * times + 0.25, rel=1e-12)  # rounding
    assert np.array_equal(channel.of(sampler, times), 2.0 * times + 0.5)


def test_an_angle_reads_its_wave() -> None:
    channel = Channel("phi", "rad", 0.01, "base.phi", offset=0.5)
    times = np.linspace(0.0, 7.0, 9)
    wave = {"wave:phi": 0.02, "cycles:phi": 3.0, "phase:phi": 0.4}
    read = channel.of(Sampler(times, times), times, wave)
    reading = times + 0.5
    assert read == pytest.approx(reading + 0.02 * np.sin(3.0 * reading + 0.4), rel=1e-12)
    once = channel.of(Sampler(times, times), times, {"wave:phi": 0.02, "wave:x": 9.0})
    assert once == pytest.approx(reading + 0.02 * np.sin(reading), rel=1e-12)  # rounding


def test_declared_gain_and_bias_are_recovered(folder: Path) -> None:
    it = problem(folder, START + YAW_GAIN)
    run = it.runs[0]
    wrong = run.data.copy()
    wrong[:, 2] *= 1.04
    simulator = Simulator(it.with_data({"one": wrong}))
    found = fit(simulator, it.nominal)
    place = it.index("error")
    assert found.low[place] < 0.04 < found.high[place]
    assert found.low[place] > 0.035  # the yaw turns by 10 rad, its noise is 4 mrad
    simulator.close()


def test_a_bias_has_the_unit_of_its_column(folder: Path) -> None:
    it = problem(folder, BIAS)
    assert it.parameters[0].targets == (("column:bias:yaw", pytest.approx(np.pi / 180.0)),)
    simulator = Simulator(it)
    clean = simulator.simulate(it.nominal, it.runs[0])
    read = simulator.simulate(np.array([10.0]), it.runs[0])
    assert read[:, :2] == pytest.approx(clean[:, :2])
    assert read[:, 2] - clean[:, 2] == pytest.approx(np.pi / 18.0)
    simulator.close()


def test_a_wave_has_the_units_of_an_angle(folder: Path) -> None:
    more = BIAS.replace("bias:yaw", "wave:yaw") + BIAS.replace("zero", "where").replace(
        "bias:yaw", "phase:yaw"
    )
    it = problem(folder, more)
    names = [p.targets[0] for p in it.parameters]
    turned = pytest.approx(np.pi / 180.0)
    assert names == [("column:wave:yaw", turned), ("column:phase:yaw", turned)]
    with pytest.raises(UnitError, match="column:cycles:yaw"):
        problem(folder, BIAS.replace("bias:yaw", "cycles:yaw"))


def test_nothing_is_simulated_again_for_another_gain(folder: Path) -> None:
    it = problem(folder, YAW_GAIN)
    simulator = Simulator(it)
    for error in (0.0, 0.1, 0.2):
        simulator.simulate(np.array([error]), it.runs[0])
    assert simulator.evaluations == 1
    simulator.close()


def test_what_is_held_still_counts(folder: Path) -> None:
    it = problem(folder, YAW_GAIN)
    simulator, held = Simulator(it), Simulator(it.hold({"error": 0.1}))
    wanted = simulator.simulate(np.array([0.1]), it.runs[0])
    assert np.array_equal(held.simulate(np.empty(0), held.problem.runs[0]), wanted)
    simulator.close()
    held.close()


def test_a_column_that_is_not_measured_is_refused_with_the_nearest(folder: Path) -> None:
    with pytest.raises(UnknownNameError, match=r"column:gain:yow.*did you mean.*column:gain:yaw"):
        problem(folder, YAW_GAIN.replace("gain:yaw", "gain:yow"))
    with pytest.raises(UnknownNameError, match=r"column:gian:yaw.*column:gain:yaw"):
        problem(folder, YAW_GAIN.replace("gain:yaw", "gian:yaw"))
    with pytest.raises(UnitError, match=r"nuisance error: column:bias:yaw"):
        problem(folder, YAW_GAIN.replace("gain:yaw", "bias:yaw").replace('"1"', '"m"'))
