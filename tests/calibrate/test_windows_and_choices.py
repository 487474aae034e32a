"""Which runs, windows and samples of logs are used, and what is said about the others."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate import Problem
from cosim.errors import ScenarioError
from tests.calibrate.test_log_habits import SIZE, SPEED, STEP, TIMES, TORQUE, read, written

HEADS = "time [s],tau [N.m],w [rad/s]"


def test_windows_begin_with_their_log(tmp_path: Path) -> None:
    log = written(HEADS, ",", 5.0 + TIMES, TORQUE, SPEED)
    problem = read(tmp_path, log, RUN="window = 1.0")
    assert [run.name for run in problem.runs] == ["one 0", "one 1"]
    np.testing.assert_allclose(problem.run("one 1").data[:, 0], SPEED[100:201], rtol=1e-8)


def gapped(folder: Path, first: float, last: float, top: str = "lead = 0.2") -> Problem:
    """Windows of half a second, with a torque that is not known for a while."""
    torque = np.where(np.abs(TIMES - 0.5 * (first + last)) < 0.5 * (last - first), np.nan, TORQUE)
    return read(folder, written(HEADS, ",", TIMES, torque, SPEED), TOP=top, RUN="window = 0.5")


@pytest.mark.parametrize(
    ("first", "last", "reason"),
    [
        (0.835, 0.925, "tau is not known for 0.1 s after -0.17 s"),
        (0.745, 0.895, "tau is not known when it begins"),
        (0.745, 1.695, "tau is not known when it begins"),
    ],
)
def test_a_window_whose_inputs_are_not_known_when_it_begins_is_left_out(
    tmp_path: Path, first: float, last: float, reason: str
) -> None:
    problem = gapped(tmp_path, first, last)
    left = [f for f in problem.source.findings if "this window is left out" in f.text]
    assert (left[0].severity, left[0].kind, left[0].run) == ("warning", "gap", "one 2")
    assert left[0].text.startswith(reason)
    names = {run.name for run in problem.runs}
    assert names == {f"one {k}" for k in range(5)} - {f.run for f in left}
    assert {"one 0", "one 4"} <= names


def test_a_log_of_whose_windows_none_is_left_is_refused(tmp_path: Path) -> None:
    torque = np.where(TIMES < 0.5, np.nan, TORQUE)
    log = written(HEADS, ",", TIMES, torque, SPEED)
    with pytest.raises(ScenarioError, match="no run is left: the inputs are not known where any"):
        read(tmp_path, log, RUN="window = 2.0")


def test_a_held_input_that_is_empty_is_named(tmp_path: Path) -> None:
    rows = [f"{time:.9g},,{w:.9g},{time:.9g}" for time, w in zip(TIMES, SPEED, strict=True)]
    log = "\n".join(["time,tau,w,seen", *rows]) + "\n"
    message = "column 'tau' has no values, but drives an input; 300 of 300 cells hold no number"
    with pytest.raises(ScenarioError, match=message):
        read(tmp_path, log, COLUMNS='tau = { time = "seen", hold = true }')


def test_samples_are_those_of_the_grid(tmp_path: Path) -> None:
    log = written(HEADS, ",", TIMES, TORQUE, SPEED)
    run = read(
        tmp_path, log, TOP="resample = 0.005", COLUMNS="tau = { hold = true }\nw = {}",
        RUN="samples = [41, 81]",
    ).run("one")  # fmt: skip
    assert run.times.size == 41
    np.testing.assert_allclose(run.data[::2, 0], SPEED[20:41], rtol=1e-8)


def test_a_part_of_a_log_is_advised_where_it_helps_only(tmp_path: Path) -> None:
    jumped = written(HEADS, ",", np.where(TIMES > 2.0, TIMES + 1e5, TIMES), TORQUE, SPEED)
    with pytest.raises(ScenarioError, match="give each side a file and a run of its own"):
        read(tmp_path, jumped, TOP="resample = 0.01", RUN="samples = [1, 200]")
    read(tmp_path, jumped, RUN="samples = [1, 200]")
    back = np.where(np.arange(SIZE) > 200, TIMES - 0.5, TIMES)
    log = written(HEADS + ",seen", ",", TIMES, TORQUE, SPEED, back)
    column = 'w = { time = "seen" }'
    with pytest.raises(ScenarioError, match="there twice and sort the others") as refused:
        read(tmp_path, log, RUN="samples = [1, 200]", COLUMNS=column)
    assert "with samples" not in str(refused.value)
    log = written(HEADS, ",", back, TORQUE, SPEED)
    with pytest.raises(ScenarioError, match="take the rows on one side with samples"):
        read(tmp_path, log)
    with pytest.raises(ScenarioError, match=r"goes back by 0\.49 .* sort the others$"):
        read(tmp_path, log, TOP="resample = 0.01", COLUMNS="tau = { hold = true }\nw = {}")
    run = read(tmp_path, log, RUN="samples = [1, 201]").run("one")
    assert run.times[-1] == pytest.approx(200 * STEP)


def test_a_choice_that_no_run_meets_is_refused_with_what_there_is(tmp_path: Path) -> None:
    more = 'load = 2\n[[run]]\nname = "two"\nfile = "one.csv"\npurpose = "validation"\nload = 4\n'
    message = "only: no run has load = 3; there is load = 2; load = 4"
    with pytest.raises(ScenarioError, match=re.escape(message)):
        read(tmp_path, written(), TOP="only = { load = 3 }", RUN=more)
    (run,) = read(tmp_path, written(), TOP="only = { load = 4 }", RUN=more).runs
    assert run.name == "two"


@pytest.mark.parametrize(
    ("rows", "gap", "said"), [(6, "", True), (5, "", False), (6, "0.1", False)]
)
def test_a_start_that_is_measured_late_is_said(
    tmp_path: Path, rows: int, gap: str, said: bool
) -> None:
    """Later than what counts as a gap; the value at the beginning may have been another one."""
    log = written(HEADS, ",", TIMES, TORQUE, np.where(np.arange(SIZE) < rows, np.nan, SPEED))
    top = (f"gap = {gap}\n" if gap else "") + '[starts]\n"first:w" = "load.w"'
    problem = read(tmp_path, log, TOP=top)
    assert problem.run("one").starts["load.w"] == pytest.approx(SPEED[rows])
    found = [f for f in problem.source.findings if f.kind == "start"]
    assert [(f.severity, f.run, f.column) for f in found] == [("warning", "one", "w")] * said
    assert not said or found[0].text.startswith("is measured only from 0.06 s (6 rows) after")
