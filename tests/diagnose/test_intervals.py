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
from tests.problems import simulator

pytestmark = pytest.mark.slow

EXAMPLE = Path(__file__).parents[2] / "scenarios/motor_bench/data/MB-12"
LABEL = "coulomb at load.flange"
STRENGTH = "load.flange.coulomb.tau_c"


def calibrated(problem: Problem, label: str = LABEL) -> Estimate:
    """The declared parameters and the effect."""
    search = Search(simulator(problem), only=[c for c in candidates(problem) if c.label == label])
    winner = search.round(search.calibrated()).winner
    search.close()
    assert winner is not None
    return winner.estimate


def test_a_factor_on_all_torques_stays_open(tmp_path: Path) -> None:
    """Friction, damping, inertia and efficiency by one factor: nothing that is measured changes."""
    bench = benches(3, 12, 61)[13]
    assert bench.effect == "coulomb"
    (place,) = write_sets(tmp_path, [bench], SHEET, 5, 2.0)
    estimate = calibrated(read_problem(place))
    names = list(estimate.problem.names)
    for name, value in {**bench.parameters, STRENGTH: bench.size}.items():
        k = names.index(name)
        # nine of 95 %; the fit ends at eta = 0.781, and its derivatives alone give 0.001 for that
        assert estimate.low[k] <= value <= estimate.high[k], name
    assert not estimate.identifiable[names.index("eta")]


def test_a_valley_beside_limits_stays_open(tmp_path: Path) -> None:
    """Efficiency, damping and inertia by nearly one factor, beside limits that are met by ticks."""
    bench = benches(3, 11, 121)[35]
    assert bench.effect == "saturation"
    (place,) = write_sets(tmp_path, [bench], SHEET, 121, 3.0)
    estimate = calibrated(
        read_problem(place), "torque_constant_saturation at motor.torque_constant"
    )
    names = list(estimate.problem.names)
    for name, value in bench.parameters.items():
        k = names.index(name)
        # derivatives alone give J_load 3e-4 kg.m2 and miss by 10 of that
        assert estimate.low[k] <= value <= estimate.high[k], name
    k = names.index("eta")
    # half of what the sheet leaves open, 0.08: J_load meets its bound there
    assert estimate.high[k] - estimate.low[k] > 0.04
    assert estimate.identifiable[names.index("acc_max")]


@pytest.mark.parametrize("seed", [4, 6])
def test_what_the_data_tell_stays_told(seed: int) -> None:
    rig = example(EXAMPLE, 4.0)
    (item,) = [c for c in catalogue(rig) if c.label == LABEL]
    truth = made(rig, item, 1.0, seed)
    estimate = calibrated(truth.problem)
    for name in ("R_a", "K_t", "Kp_v", "Ki_v", "acc_max"):
        k = list(estimate.problem.names).index(name)
        assert estimate.identifiable[k], name
        # of ten intervals of 95 % one or two miss by chance, hardly any by half of its width more
        away = abs(truth.parameters[name] - estimate.theta[k])
        assert away <= 0.75 * (estimate.high[k] - estimate.low[k])
