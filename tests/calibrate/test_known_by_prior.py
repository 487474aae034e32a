"""What the data say nothing of is known as well as it was before, and no fit ends by it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate.calibration import calibrated
from cosim.calibrate.mapping import read_problem
from cosim.diagnose.candidates import candidates
from tests.diagnose import disc
from tests.problems import simulator

SMOOTHING, STRENGTH = "load.flange.coulomb.w_0", "load.flange.coulomb.tau_c"
DEVIATION = 4e-4
"""Of the smoothing, before [rad/s]."""


@pytest.mark.parametrize("rubs", [False, True])
def test_a_parameter_without_influence_keeps_its_prior(tmp_path: Path, rubs: bool) -> None:
    """How sharply friction sets in says nothing where there is none."""
    size = 0.05 if rubs else 0.0
    problem = read_problem(
        disc.write(tmp_path, lambda w, theta, t: size * math.tanh(w / 2e-3), seconds=1.6)
    )
    (law,) = [c for c in candidates(problem) if c.label == "coulomb at load.flange"]
    whole = law.added_to(problem).hold({STRENGTH: size})
    whole = whole.with_parameters(
        [replace(p, prior=DEVIATION) if p.name == SMOOTHING else p for p in whole.parameters]
    )
    found, _ = calibrated(simulator(whole))
    at = whole.index(SMOOTHING)
    assert np.all(np.linalg.eigvalsh(found.covariance / np.outer(whole.scale, whole.scale)) > 0.0)
    if rubs:
        assert found.deviation[at] < 0.99 * DEVIATION
    else:
        # variances grow with what the fit leaves over the noise, half a percent here
        assert found.deviation[at] == pytest.approx(DEVIATION, rel=0.01)
        assert found.low[at] < whole.nominal[at] < found.high[at]
