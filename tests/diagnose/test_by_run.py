"""A parameter that differs between runs is said; where it does not, and a law is missing, not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate.mapping import read_problem
from cosim.diagnose import diagnose
from cosim.diagnose.by_run import by_run
from cosim.diagnose.candidates import candidates
from cosim.diagnose.search import Search
from tests.diagnose import disc
from tests.problems import simulator

pytestmark = pytest.mark.slow
FRICTIONS = {"sweep": 0.03, "steps": 0.04, "check": 0.045}
"""[N.m.s/rad] As grease is, on one day and on another."""


def nothing(w: float, theta: float, t: float) -> float:
    return 0.0


def test_a_friction_that_differs_between_runs_is_said(tmp_path: Path) -> None:
    folder = disc.write(tmp_path, nothing, names=FRICTIONS, frictions=FRICTIONS)
    problem = read_problem(folder)
    # a catalogue takes its time to see that it has no such law
    result = diagnose(problem, law=False, without={c.effect for c in candidates(problem)})
    assert result.verdict == "unexplained"
    first, *others = result.by_run
    assert first.parameter == "b" and not others and not first.left
    assert first.explained == pytest.approx(1.0, abs=0.01)
    for run, friction in FRICTIONS.items():
        value = first.values[run]
        assert value.low <= friction <= value.high and value.determined
        assert value.value == pytest.approx(friction, rel=0.03)  # a per cent is its deviation
    assert "One value of b for each run, from 0.0" in result.reason
    assert " in sweep to 0.04" in result.reason and " N.m.s/rad in check" in result.reason
    assert "and leave noise: look for what differs between the runs." in result.reason
    told = result.to_dict()["by_run"][0]["values"]["check"]
    assert told["ci95"] == [first.values["check"].low, first.values["check"].high]


def test_a_friction_that_is_another_in_the_unused_run_alone_is_found(tmp_path: Path) -> None:
    frictions = {"sweep": disc.B, "steps": disc.B, "check": 1.2 * disc.B}
    folder = disc.write(tmp_path, nothing, names=frictions, frictions=frictions)
    search = Search(simulator(read_problem(folder), 1), only=[])
    (item,) = by_run(search, search.calibrated())
    search.close()
    assert item.parameter == "b" and not item.left
    assert item.values["check"].value == pytest.approx(1.2 * disc.B, rel=0.03)


def test_a_law_that_is_missing_does_not_differ_between_runs(tmp_path: Path) -> None:
    """It acts in each of them as it does in the others, and a friction per run explains half."""
    folder = disc.write(tmp_path, lambda w, theta, t: 0.1 * float(np.sign(w) * abs(w) ** 0.3))
    search = Search(simulator(read_problem(folder), 1), only=[])
    assert not by_run(search, search.calibrated())
    search.close()
