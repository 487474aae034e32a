"""Columns of a log that are late, or early, are named with their delay; no FMU carries it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from cosim.calibrate.clocks import Shift
from cosim.calibrate.mapping import read_problem
from cosim.calibrate.problem import Problem
from cosim.diagnose.candidates import Candidate, delays, drifts
from cosim.diagnose.models import Fitted
from cosim.diagnose.search import Search
from cosim.intake.example import RADIUS, drive, write_csv
from tests.problems import simulator
from tests.robot_logs import CLOCK, ROBOT, START, write_system

pytestmark = pytest.mark.slow

NAMES = ("one", "two", "three", "four")
MAPPING = f"""{ROBOT}[[parameter]]
name = "r"
unit = "m"
nominal = {RADIUS}
min = 0.04
max = 0.06
targets = "base.r"
"""


def written(folder: Path, late: float, mapping: str = MAPPING, *, slow: float = 0.0) -> Problem:
    """Runs of a robot by exact arcs, whose camera's clock is late, or slow; no FMU is in them."""
    runs = ""
    for seed, name in enumerate(NAMES):
        run = drive(40 + seed, late=late)
        begin = run.stamped[0]
        stamped = begin + (run.stamped - begin) / (1.0 - slow)
        write_csv(replace(run, stamped=stamped), name, folder)
        runs += (
            f'[[run]]\nname = "{name}"\npurpose = "{"validation" if seed > 1 else "identification"}'
            f'"\nfiles = {{ cmd = "{name}_cmd.csv", pose = "{name}_pose.csv" }}\n'
        )
    write_system(folder)
    (folder / "dataset.toml").write_text(mapping + START + runs)
    return read_problem(folder)


def found(problem: Problem) -> tuple[Fitted, Fitted | None]:
    search = Search(simulator(problem, 1), only=[*delays(problem), *drifts(problem)])
    base = search.calibrated()
    winner = search.round(base).winner
    search.close()
    return base, winner


@pytest.mark.parametrize("late", [0.2, -0.12])
def test_a_late_camera_and_late_wheels_are_named_with_their_delay(
    tmp_path: Path, late: float
) -> None:
    """Which of both clocks is the late one no log says: one early is the other late."""
    base, winner = found(written(tmp_path, late))
    assert winner is not None
    effect = winner.effects[-1]
    assert effect.label in ("delay at log.base.outputs", "delay at log.base.inputs")
    name = f"{effect.prefix}t_d"
    place = winner.problem.index(name)
    assert winner.estimate.low[place] < late < winner.estimate.high[place]
    # a twentieth of the camera's interval of 40 ms: cut at its samples, clocks are known better
    assert winner.estimate.values[name] == pytest.approx(late, abs=2e-3)
    assert 2.0 * base.estimate.robust > 4.0 * base.estimate.count
    assert 2.0 * winner.estimate.robust < 1.2 * winner.estimate.count


@pytest.mark.parametrize("slow", [0.01, -0.006])
def test_a_clock_that_drifts_is_named_with_its_rate(tmp_path: Path, slow: float) -> None:
    """A clock that is too fast would need the model's future; so the comparison is shifted."""
    base, winner = found(written(tmp_path, 0.0, slow=slow))
    assert winner is not None
    effect = winner.effects[-1]
    assert effect.label == "clock_skew at log.base.outputs" and effect.change == {}
    name = f"{effect.prefix}skew"
    place = winner.problem.index(name)
    assert winner.estimate.low[place] < slow < winner.estimate.high[place]
    # what is late by 2 ms at the end of a run of 12 s, a twentieth of the camera's interval
    assert winner.estimate.values[name] == pytest.approx(slow, abs=2e-3 / 12.0)
    assert 2.0 * base.estimate.robust > 1.5 * base.estimate.count
    assert 2.0 * winner.estimate.robust < 1.2 * winner.estimate.count


def test_a_declared_drift_is_not_named_again(tmp_path: Path) -> None:
    declared = CLOCK.replace("clock:", "clock:drift:").replace('unit = "s"', 'unit = "1"')
    declared = declared.replace("0.5", "0.05")
    problem = written(tmp_path, 0.0, MAPPING + declared, slow=0.01)
    assert not drifts(problem)
    base, winner = found(problem)
    assert winner is None
    assert base.estimate.values["clock"] == pytest.approx(0.01, abs=2e-3 / 12.0)  # as above


def test_clocks_that_agree_are_not_named(tmp_path: Path) -> None:
    assert found(written(tmp_path, 0.0))[1] is None


def test_a_declared_clock_is_not_named_again(tmp_path: Path) -> None:
    """As a nuisance it is the same quantity: it takes what the effect would."""
    problem = written(tmp_path, 0.2, MAPPING + CLOCK)
    few = {c.port: c.column for c in delays(problem)}
    assert set(few) == {"base.w_l", "base.w_r", "base.inputs"}
    assert few["base.inputs"] == Shift(inputs=("base.w_l", "base.w_r"))
    base, winner = found(problem)
    assert winner is None
    assert base.estimate.values["clock"] == pytest.approx(0.2, abs=2e-3)  # as above


def test_a_delay_is_of_columns_and_needs_no_fmu(tmp_path: Path) -> None:
    problem = written(tmp_path, 0.0)
    few = delays(problem)
    assert {c.port for c in few} == {
        "x", "y", "yaw", "base.outputs", "base.w_l", "base.w_r", "base.inputs"
    }  # fmt: skip
    for item in few:
        added = item.added_to(problem)
        assert item.change == {} and added.instances == problem.instances
        delay = added.parameters[-1]
        assert (delay.minimum, delay.maximum, delay.nominal) == (-0.5, 0.5, 0.0)
        assert delay.name == f"{item.prefix}t_d"
    # all inputs late and all channels late: one model, so no log can tell, and both are named
    shifts = {c.port: c.column for c in few}
    assert shifts["base.inputs"] == shifts["base.outputs"] != shifts["base.w_l"]
    assert isinstance(few[0], Candidate) and few[0].effect == "delay"
