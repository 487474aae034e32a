"""A gain that only a column of the log has is named there; what a sensor gives is asked there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate.mapping import read_problem
from cosim.calibrate.problem import Problem
from cosim.diagnose.adding import made_of
from cosim.diagnose.candidates import Candidate, misread
from cosim.diagnose.models import Fitted
from cosim.diagnose.search import Search
from tests.diagnose.test_late_columns import MAPPING, written
from tests.problems import simulator
from tests.robot_logs import YAW_GAIN

pytestmark = pytest.mark.slow

YAW = 2
"""Column of the yaw among x, y and yaw."""


def wrong(problem: Problem, error: float, column: int = YAW) -> Problem:
    """The problem with a column that reads too much, about where a run begins."""
    data = {}
    for run in problem.runs:
        rows = run.data.copy()
        rows[:, column] *= 1.0 + error
        data[run.name] = rows
    return problem.with_data(data)


def found(problem: Problem, few: list[Candidate]) -> tuple[Fitted, Fitted | None]:
    search = Search(simulator(problem, 1), only=few)
    base = search.calibrated()
    winner = search.round(base).winner
    search.close()
    return base, winner


@pytest.mark.parametrize("error", [0.03, -0.05])
def test_a_yaw_that_reads_too_much_is_named_with_its_error(tmp_path: Path, error: float) -> None:
    problem = wrong(written(tmp_path, 0.0), error)
    base, winner = found(problem, misread(problem))
    assert winner is not None
    effect = winner.effects[-1]
    assert effect.label == "gain at log.yaw" and effect.change == {}
    place = winner.problem.index("log.yaw.gain.error")
    assert winner.estimate.low[place] < error < winner.estimate.high[place]
    assert 2.0 * winner.estimate.robust < 1.2 * winner.estimate.count < base.estimate.robust
    # nothing of it is in the system: the model runs as it did
    table = made_of(problem, winner)
    assert table["variants"] == {} and not any("column:" in name for name in table["values"])


@pytest.mark.parametrize("rate", [0.004, -0.01])
def test_a_heading_that_drifts_is_named_with_its_rate(tmp_path: Path, rate: float) -> None:
    """As a gyro's does."""
    problem = written(tmp_path, 0.0)
    data = {}
    for run in problem.runs:
        rows = run.data.copy()
        rows[:, YAW] += rate * (run.times - run.times[0])
        data[run.name] = rows
    problem = problem.with_data(data)
    _, winner = found(problem, misread(problem))
    assert winner is not None and winner.effects[-1].label == "zero_drift at log.yaw"
    place = winner.problem.index("log.yaw.zero_drift.rate")
    assert winner.estimate.low[place] < rate < winner.estimate.high[place]
    assert winner.problem.parameters[place].unit == "rad/s"
    assert 2.0 * winner.estimate.robust < 1.2 * winner.estimate.count


def test_a_path_of_the_same_unit_is_no_sensor(tmp_path: Path) -> None:
    """A base whose turn may be wrong has no gyro for that."""
    problem = written(tmp_path, 0.0)
    turning = problem.changed(
        channels=[replace(c, signal="base.w_z") if c.name == "yaw" else c for c in problem.channels]
    )
    assert {c.label for c in misread(turning)} >= {"bias at log.yaw", "gain at log.yaw"}


def test_columns_that_read_rightly_are_not_named(tmp_path: Path) -> None:
    problem = written(tmp_path, 0.0)
    assert found(problem, misread(problem))[1] is None


def test_a_bias_that_a_run_begins_with_is_the_start_of_the_run(tmp_path: Path) -> None:
    """Both move all of a column by as much: nothing is missed."""
    problem = written(tmp_path, 0.0)
    moved = problem.with_data({run.name: run.data + np.array([0.1, 0, 0]) for run in problem.runs})
    assert found(moved, misread(moved))[1] is None


@pytest.mark.parametrize("cycles", [1, 2])
def test_an_angle_that_is_wrong_by_a_wave_is_named_with_its_cycles(
    tmp_path: Path, cycles: int
) -> None:
    """A compass beside iron, and one beside iron that it magnetises."""
    size, phase = 0.02, -0.7
    problem = written(tmp_path, 0.0)
    data = {}
    for run in problem.runs:
        rows = run.data.copy()
        rows[:, YAW] += size * np.sin(cycles * rows[:, YAW] + phase)
        data[run.name] = rows
    problem = problem.with_data(data)
    _, winner = found(problem, misread(problem))
    assert winner is not None and winner.effects[-1].label == "angle_ripple at log.yaw"
    values = winner.estimate.values
    turns = {**winner.problem.held, **values}["log.yaw.angle_ripple.n"]
    # the wave of the reading, not of the truth: 2 % of a radian later, and noise of 4 mrad
    assert turns == pytest.approx(cycles, abs=0.02)
    assert values["log.yaw.angle_ripple.A"] == pytest.approx(size, rel=0.03)
    assert values["log.yaw.angle_ripple.psi"] == pytest.approx(phase, abs=0.06)
    assert 2.0 * winner.estimate.robust < 1.2 * winner.estimate.count


def test_a_declared_gain_is_not_named_again(tmp_path: Path) -> None:
    problem = wrong(written(tmp_path, 0.0, MAPPING + YAW_GAIN), 0.03)
    few = {c.label for c in misread(problem)}
    assert "gain at log.yaw" not in few and {"bias at log.yaw", "gain at log.x"} <= few


@pytest.mark.parametrize(
    ("rig", "columns"),
    # the angle is logged by another sensor than the encoder that the loop reads
    [("MB-12", {"voltage", "angle"}), ("OB-06", set())],
)
def test_what_a_sensor_of_the_system_gives_is_asked_at_the_sensor(
    rig: str, columns: set[str]
) -> None:
    assert {c.port for c in misread(read_problem(rig))} == columns
