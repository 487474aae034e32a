"""Where an unknown input enters, and the shape that it has."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.bench import Bench
from benchmarks.motor_plant import draw, write_sets
from cosim.calibrate.mapping import read_problem
from cosim.diagnose.candidates import candidates
from cosim.diagnose.localise import PLACES, everywhere, localise, regressed
from cosim.diagnose.search import Search
from tests.problems import simulator

pytestmark = pytest.mark.slow

SHEET = Path(__file__).parents[2] / "scenarios/motor_bench/data/motor_bench.toml"
SIZE = 0.15
KNOTS = np.linspace(-1.0, 1.0, 9)


def hats(driver: np.ndarray) -> np.ndarray:
    """Responses of a system that shows its input as it is."""
    place = (driver - KNOTS[0]) / (KNOTS[1] - KNOTS[0])
    return np.column_stack([np.clip(1 - np.abs(place - k), 0.0, None) for k in range(KNOTS.size)])


@pytest.mark.parametrize("there", [True, False])
def test_a_curve_is_recovered_and_noise_is_not_taken_for_one(there: bool) -> None:
    random = np.random.default_rng(0)
    driver = random.uniform(-1.0, 1.0, 4000)
    truth = np.abs(KNOTS) - 0.5  # piecewise linear between the knots: hats hold it exactly
    responses = hats(driver)
    residual = random.standard_normal(driver.size) + (responses @ truth if there else 0.0)
    found = regressed(responses, residual, "velocity", "", KNOTS)
    if there:
        assert found.evidence > 100.0
        # four standard deviations of each knot
        assert np.all(np.abs(found.value - truth) < 4.0 * found.deviation)
    else:
        # evidence of a model that noise alone prefers: e^3 = 20 times as likely is one in 20
        assert found.evidence < 3.0


def test_the_missing_force_is_found_where_it_acts(tmp_path: Path) -> None:
    plain = draw(np.random.default_rng(3))
    (folder,) = write_sets(
        tmp_path, [Bench(plain.parameters, "supply_sag", SIZE)], SHEET, 5, 2.0, ("ST", "MS", "LW")
    )
    problem = read_problem(folder)
    wanted = {("motor", "winding"), ("load", "flange")}
    chosen = {(c.instance, c.port): c for c in candidates(problem)}
    search = Search(simulator(problem), only=[chosen[place] for place in sorted(wanted)])
    places = localise(search, search.calibrated(), search.known)
    assert {(p.instance, p.port) for p in places} == wanted
    best, other = places
    assert (best.instance, best.port) == ("motor", "winding")
    # 4.6 nats: a hundred times as likely
    assert best.evidence > other.evidence + 4.6
    assert best.curves[0].explained > 0.5
    # a catalogue that has nothing there does not hide the place
    search.known = [chosen["load", "flange"]]
    ranked = localise(search, search.calibrated(), search.known)
    assert [(p.instance, p.port) for p in ranked] == [("load", "flange")]
    found = everywhere(search, search.calibrated())
    assert len(found) > PLACES
    # an error of the torque constant does nearly the same, to first order
    assert ("motor", "winding") in [(p.instance, p.port) for p in found[:2]]
    search.close()
