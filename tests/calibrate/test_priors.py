"""What is known beforehand stays known, also where the model is off."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from cosim.calibrate import read_problem
from cosim.calibrate.checks.examine import check_fit
from cosim.calibrate.checks.prior import FAR
from cosim.calibrate.fit import fit
from tests.diagnose import disc
from tests.problems import simulator


@pytest.mark.slow
@pytest.mark.parametrize("dry", [0.0, 0.05])
def test_a_misfit_does_not_undo_a_prior(tmp_path: Path, dry: float) -> None:
    place = disc.write(tmp_path, lambda w, theta, t: dry if w > 0.0 else -dry, seconds=2.0)
    problem, prior = read_problem(place), 1e-4
    known = replace(problem.parameters[0], nominal=disc.J, prior=prior)
    problem = problem.changed(parameters=(known, *problem.parameters[1:]))
    found = fit(simulator(problem))
    # 1.96 deviations, Student's factor of few blocks a little more; by the data alone it is wider
    assert found.high[0] - found.low[0] < 2.0 * 2.2 * prior


@pytest.mark.slow
@pytest.mark.parametrize("far", [3.0, 6.0])
def test_a_value_far_from_its_prior_is_told(tmp_path: Path, far: float) -> None:
    """The twin: three deviations are chance."""
    problem, prior = read_problem(disc.write(tmp_path, lambda w, theta, t: 0.0)), 1e-3
    known = replace(problem.parameters[0], nominal=disc.J + far * prior, prior=prior)
    found = fit(simulator(problem.changed(parameters=(known, *problem.parameters[1:]))))
    told = [str(f) for f in check_fit(found) if f.kind == "prior"]
    assert len(told) == (far > FAR)
    if told:
        assert "J ended at 0.0" in told[0] and "deviations of its prior from 0.026 kg" in told[0]
        assert "the model lacks something, or the prior of 0.001 kg" in told[0]
