"""Unused runs count beside what the parameters' deviations make of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate import read_problem
from cosim.calibrate.foretelling import foretold
from cosim.diagnose import diagnose
from cosim.diagnose.whiteness import UNNAMED, whiteness_tests
from tests.diagnose import built, pendulum


def nothing(w: float, theta: float, t: float) -> float:
    return 0.0


@pytest.mark.parametrize("error", ["none", "parameters", "law"])
def test_errors_of_the_parameters_are_taken_off_and_others_stay(tmp_path: Path, error: str) -> None:
    """A disc that lacks nothing; three deviations of its parameters along their worst direction."""
    with built.rig(tmp_path, nothing) as rig:
        search, base = rig.search, rig.base
        theta, covariance = base.estimate.theta, 25.0 * base.estimate.covariance
        known = replace(base, estimate=replace(base.estimate, covariance=covariance))
        residual = search.check_data - base.check
        if error == "parameters":
            values, vectors = np.linalg.eigh(covariance)
            moved = theta + 3.0 * vectors[:, -1] * np.sqrt(values[-1])
            (_, off), (_, right) = (
                base.simulator.residuals(at, ["check"])[0] for at in (moved, theta)
            )
            residual = residual + search.checking.vector([off - right])
        if error == "law":
            (run,) = search.checking.runs
            wave = np.tile(np.sin(7.0 * run.times)[:, None], (1, 2))
            residual = residual + search.checking.vector([wave])
        rows = zip(search.checking.names, search.checking.by_run(residual), strict=True)
        rest = search.checking.vector([v for _, v in foretold(known.estimate, list(rows))])
        slow = max(t.slow for t in whiteness_tests(residual, search.checking))
        left = max(t.slow for t in whiteness_tests(rest, search.checking))
        assert (slow > UNNAMED) == (error != "none")
        assert (left > UNNAMED) == (error == "law")
        # nothing is taken off that is not there, but its share of noise: half a nat each
        assert abs(rest @ rest - residual @ residual) < 2.0 * theta.size or error != "none"


@pytest.mark.slow
def test_a_run_that_magnifies_deviations_is_no_lack(tmp_path: Path) -> None:
    """A pendulum that goes over the top in its unused run; the twin is a law, above."""
    problem = read_problem(pendulum.write(tmp_path))
    found = diagnose(problem, law=False).to_dict()
    assert found["verdict"] == "nothing_missing", found["reason"]
    phi = found["channels"]["phi"]
    assert phi["before"]["identification"] < 1.1 * phi["noise_rms"]
    assert phi["before"]["validation"] > 1.5 * phi["noise_rms"]
    told = [w for w in found["warnings"] if "no more than the intervals of the parameters" in w]
    assert any("phi is off by" in w for w in told)
