"""The committed set of the omnidirectional rig, which lacks nothing that its sheet does not say."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim.calibrate import Simulator, read_problem
from cosim.calibrate.estimate import channel_rms
from cosim.calibrate.fit import DRAFT, fit
from cosim.calibrate.nuisance import settled

DATA = Path(__file__).resolve().parents[2] / "scenarios" / "omni_bench" / "data" / "OB-06"


@pytest.mark.slow
def test_the_model_of_the_sheet_leaves_the_noise_in_unused_runs() -> None:
    problem = read_problem(DATA)
    simulator = Simulator(problem)
    unused = [run.name for run in problem.runs if run.purpose == "validation"]

    def left(theta):
        start = settled(simulator, theta, unused)
        return channel_rms(problem, simulator.residuals(start, unused))

    before = left(problem.nominal)
    estimate = fit(simulator, effort=DRAFT)
    after = left(estimate.theta)
    assert len(after) == 15
    # 4700 samples: the root mean square of noise scatters by 1 %, an independent model of the
    # sheet left 0.94 to 1.06
    assert max(after.values()) < 1.1 and min(after.values()) > 0.9
    assert max(before.values()) > 2.0  # the individual is not the nominal one
