"""Commands that are held from moments between two communication steps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate import Problem, read_problem
from cosim.calibrate.simulator import Simulator
from cosim.data.signals import Table
from cosim.errors import ValueRangeError
from tests.placed import Wrong, write

STEP = 0.02


@pytest.fixture
def problem(tmp_path: Path) -> Problem:
    """One run whose commands come every 0.137 s, at moments of no step."""
    plain = read_problem(write(tmp_path, [Wrong()]))
    (run,) = plain.runs
    times = np.append(0.0, np.arange(0.0631, run.times[-1], 0.137))
    random = np.random.default_rng(3)
    inputs = {
        name: Table(times, random.uniform(1.0, 9.0, times.size), unit="rad/s", extend=True)
        for name in run.inputs
    }
    return plain.changed(runs=[replace(run, inputs=inputs)], step=STEP)


def poses(problem: Problem, step: float) -> np.ndarray:
    return Simulator(problem.changed(step=step)).simulate(problem.nominal, problem.runs[0])


def test_they_act_as_they_come_whatever_the_step(problem: Problem) -> None:
    """Read when a step begins they would be late by half of one, at random."""
    exact = poses(problem, STEP / 64)
    coarse, fine = (np.max(np.abs(poses(problem, h) - exact)) for h in (STEP, STEP / 2))
    # 10 ms late at 0.2 m/s are 2 mm; a path turns within a step that a command cuts, too
    assert coarse < 1e-4
    assert fine < coarse / 2.0


def test_the_heading_is_exact(problem: Problem) -> None:
    """It is the integral of the wheels' speeds, whose means are exact."""
    index = [c.name for c in problem.channels].index("yaw")
    apart = poses(problem, STEP)[:, index] - poses(problem, STEP / 64)[:, index]
    assert np.max(np.abs(apart)) < 1e-9


def test_a_rig_with_ticks_reads_them_itself(problem: Problem) -> None:
    """What a controller reads at its ticks is no mean."""
    ticking = problem.changed(tick=STEP)
    index = [c.name for c in problem.channels].index("yaw")
    apart = poses(ticking, STEP)[:, index] - poses(problem, STEP)[:, index]
    assert np.max(np.abs(apart)) > 1e-3


def test_a_table_that_ends_too_early_is_still_refused(problem: Problem) -> None:
    (run,) = problem.runs
    inputs = {
        name: Table(signal.times[:20], signal.values[:20], unit="rad/s")
        for name, signal in run.inputs.items() if isinstance(signal, Table)
    }  # fmt: skip
    short = problem.changed(runs=[replace(run, inputs=inputs)])
    with pytest.raises(ValueRangeError, match="but the run needs"):
        Simulator(short).simulate(short.nominal, short.runs[0])
