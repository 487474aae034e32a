"""One run whose inputs are others: turned round, exchanged, scaled; and a machine that is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate import read_problem
from cosim.calibrate.calibration import calibrated
from cosim.calibrate.checks.examine import examine
from cosim.calibrate.checks.finding import Finding
from cosim.calibrate.checks.odd_run import check_odd_run
from tests.placed import Wrong, write
from tests.problems import simulator

LEFT, RIGHT = 1, 2
RUNS = 4


def found(folder: Path, odd: int | None, change: np.ndarray, unused: int = 0) -> list[Finding]:
    """In runs of which one has its wheel speeds multiplied by a matrix."""
    write(folder, [Wrong()] * RUNS, unused=unused)
    if odd is not None:
        path = folder / f"r{odd}.csv"
        rows = np.loadtxt(path, delimiter=",", skiprows=1)
        rows[:, [LEFT, RIGHT]] = rows[:, [LEFT, RIGHT]] @ change.T
        np.savetxt(path, rows, delimiter=",", header="t,left,right,x,y,yaw", comments="")
    estimate = calibrated(simulator(read_problem(folder)))[0]
    return list(check_odd_run(estimate))


@pytest.mark.parametrize("odd", [1, RUNS - 1], ids=["fitted", "unused"])
@pytest.mark.parametrize(
    ("change", "column", "text"),
    [
        (np.diag([-1.0, 1.0]), "left", "has the sign turned round in this run alone"),
        (np.eye(2)[::-1], "left and right", "are exchanged in this run alone"),
        (np.diag([1.0, 30.0 / np.pi]), "right", "is in another unit (rpm instead of rad/s)"),
        (np.diag([1.01, 1.0]), "left", "is 1.01 times what drives the machine"),
    ],
)
def test_an_input_that_is_another_one_in_one_run(
    tmp_path: Path, odd: int, change: np.ndarray, column: str, text: str
) -> None:
    [finding] = found(tmp_path, odd, change, unused=1)
    assert (finding.severity, finding.kind) == ("error", "differs")
    assert (finding.run, finding.column) == (f"r{odd}", column)
    assert text in finding.text
    assert "Mend the log, or leave the run out" in finding.text


def test_a_run_that_nothing_of_this_explains_is_named(tmp_path: Path) -> None:
    """Both wheels are others: a warning, since a law may be excited there alone."""
    [finding] = found(tmp_path, 2, np.array([[1.0, 0.02], [0.03, 0.98]]))
    assert (finding.severity, finding.kind, finding.run) == ("warning", "differs", "r2")
    assert "does not fit the others, which leave noise by themselves" in finding.text


def test_runs_that_are_alike_have_no_odd_one(tmp_path: Path) -> None:
    """Clean ones, and such that all lack the same."""
    assert found(tmp_path, None, np.eye(2)) == []
    write(tmp_path, [Wrong(larger=0.01)] * RUNS)
    estimate = calibrated(simulator(read_problem(tmp_path)))[0]
    assert list(check_odd_run(estimate)) == []


@pytest.mark.parametrize(("odd", "named"), [([1], "r1"), (range(RUNS), "")])
def test_inputs_that_are_exchanged_in_one_run_are_not_said_of_all(
    tmp_path: Path, odd: list[int], named: str
) -> None:
    """Before a fit, at the sheet's values."""
    write(tmp_path, [Wrong()] * RUNS)
    for k in odd:
        rows = np.loadtxt(tmp_path / f"r{k}.csv", delimiter=",", skiprows=1)
        rows[:, [LEFT, RIGHT]] = rows[:, [RIGHT, LEFT]]
        np.savetxt(tmp_path / f"r{k}.csv", rows, delimiter=",", header="t,left,right,x,y,yaw",
                   comments="")  # fmt: skip
    findings = examine(simulator(read_problem(tmp_path)))
    [swapped] = [f for f in findings if f.kind == "swapped"]  # in all runs y and yaw are mirrored
    assert (swapped.severity, swapped.run, swapped.column) == ("error", named, "left and right")
    assert ("in this run and not in all others" in swapped.text) == bool(named)
