"""With dry friction, intervals hold what the data leave open, though a fit ended near a bound."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.motor_plant import write_sets
from benchmarks.own_plant import catalogue, example, made
from benchmarks.selftest import SHEET, benches
from cosim.calibrate.estimate import Estimate
from cosim.calibrate.mapping import read_problem
from cosim.calibrate.problem import Problem
from cosim.diagnose.candidates import candidates
from cosim.diagnose.search import Search

EXAMPLE = Path(__file__).parents[2] / "scenarios/motor_bench/data/MB-12"
LABEL = "coulomb at load.flange"
STRENGTH = "load.flange.coulomb.tau_c"


def calibrated(problem: Problem) -> Estimate:
    """The declared parameters and the friction."""
    search = Search(problem, only=[c for c in candidates(problem) if c.label == LABEL])
    winner = search.round(search.calibrated()).winner
    search.close()
    assert winner is not None
    return winner.estimate


def test_a_factor_on_all_torques_stays_open(tmp_path: Path) -> None:
    """Friction, damping, inertia and efficiency by one factor: nothing that is measured changes."""
    bench = benches(3, 12, 61)[13]
    assert bench.effect == "coulomb"
    (place,) = write_sets(tmp_path, [bench], SHEET, 5, 2.0)
    estimate = calibrated(read_problem(place, workers=2))
    names = list(estimate.problem.names)
    for name, value in {**bench.parameters, STRENGTH: bench.size}.items():
        k = names.index(name)
        # nine of 95 %; the fit ends at eta = 0.781, and its derivatives alone give 0.001 for that
        assert estimate.low[k] <= value <= estimate.high[k], name
    assert not estimate.identifiable[names.index("eta")]


@pytest.mark.parametrize("seed", [4, 6])
def test_what_the_data_tell_stays_told(seed: int) -> None:
    rig = example(EXAMPLE, 4.0, 2)
    (item,) = [c for c in catalogue(rig) if c.label == LABEL]
    truth = made(rig, item, 1.0, seed)
    estimate = calibrated(truth.problem)
    for name in ("R_a", "K_t", "Kp_v", "Ki_v", "acc_max"):
        k = list(estimate.problem.names).index(name)
        assert estimate.identifiable[k], name
        assert estimate.low[k] <= truth.parameters[name] <= estimate.high[k]
