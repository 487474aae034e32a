"""The generated machine for the casters' question has what it says, and nothing else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.caster_question import EFFECTS, FLOOR, SWIVEL, write
from cosim.calibrate.estimate import channel_rms
from cosim.calibrate.mapping import read_problem
from cosim.calibrate.nuisance import settled
from cosim.calibrate.problem import Problem
from cosim.diagnose.candidates import candidates
from tests.problems import simulator

pytestmark = pytest.mark.slow


def left(problem: Problem, truth: dict[str, float]) -> dict[str, float]:
    """Residual RMS over the noise by channel, at the true parameters and fitted start poses."""
    theta = problem.nominal
    for name, value in truth.items():
        if name in problem.names:
            theta[problem.index(name)] = value
    runner = simulator(problem)
    theta = settled(runner, theta, [run.name for run in problem.runs])
    found = channel_rms(problem, runner.residuals(theta, None))
    runner.close()
    return found


def test_with_both_effects_the_logs_hold_noise_alone(tmp_path: Path) -> None:
    truth = write(tmp_path, 0.3, 0.2, 1)
    assert (truth[SWIVEL], truth[FLOOR]) == (0.3, 0.2)
    declared = read_problem(tmp_path)
    assert {r.purpose for r in declared.runs} == {"identification", "validation"}
    lacking = left(declared, truth)
    assert lacking["base_y"] > 2.0 and lacking["motor_current_l"] > 2.0
    whole = declared
    for effect, place in EFFECTS:
        (item,) = [c for c in candidates(whole) if (c.effect, c.place) == (effect, place)]
        whole = item.added_to(whole)
    # 7000 samples per channel: the RMS of white noise is within 4 % of 1, five deviations
    assert left(whole, truth) == pytest.approx(dict.fromkeys(lacking, 1.0), abs=0.04)


def test_without_them_the_declared_model_is_right(tmp_path: Path) -> None:
    truth = write(tmp_path, 0.0, 0.0, 2)
    found = left(read_problem(tmp_path), truth)
    assert np.allclose(list(found.values()), 1.0, atol=0.04)
