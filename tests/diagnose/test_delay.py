"""Commands that are held arrive late by whole samples, which no derivative tells."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from benchmarks.bench import Bench
from benchmarks.motor_plant import write_sets
from benchmarks.selftest import SHEET, benches
from cosim.calibrate.mapping import read_problem
from cosim.calibrate.problem import Problem
from cosim.diagnose.candidates import candidates
from cosim.diagnose.search import Search
from tests.problems import simulator

pytestmark = pytest.mark.slow

LABELS = ("delay at motor.command", "gain at motor.command", "asymmetric_viscous at load.flange")


@pytest.fixture(scope="module")
def late() -> Bench:
    """A bench whose commands arrive 8 ms late: calibrated without, all parameters go to bounds."""
    return next(b for b in benches(3, 12, 73) if b.effect == "command_delay")


@pytest.fixture(scope="module")
def problem(late: Bench, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Problem]:
    (place,) = write_sets(
        tmp_path_factory.mktemp("late"), [late], SHEET, 73, 5.0, ("ST", "LV", "MX")
    )
    found = read_problem(place)
    yield found
    simulator(found).close()


def test_a_delay_of_held_commands_is_found_to_the_sample(problem: Problem, late: Bench) -> None:
    told: list[str] = []
    search = Search(
        simulator(problem), told.append, [c for c in candidates(problem) if c.label in LABELS]
    )
    base = search.calibrated()
    assert len(base.estimate.at_bound) > 4  # where no first order leads to a delay
    winner = search.round(base).winner
    search.close()
    assert winner is not None and winner.effects[-1].label == LABELS[0]
    assert any("around their nominal values" in line for line in told)
    assert not search.lacking(winner)
    estimate = winner.estimate
    names = estimate.problem.names
    truth = {"motor.command.delay.t_d": late.size}
    truth |= {n: late.parameters[n] for n in names if n in late.parameters}
    assert len(truth) == len(names) == 9
    for name, value in truth.items():
        i = names.index(name)
        assert estimate.low[i] <= value <= estimate.high[i], name
    # half a period of the delay's grid, as a uniform error, and little else
    i = names.index("motor.command.delay.t_d")
    assert estimate.high[i] - estimate.low[i] < 8e-4


def test_what_is_found_at_once_is_not_sought_again(clean_bench: Problem) -> None:
    told: list[str] = []
    known = [c for c in candidates(clean_bench) if c.label in LABELS]
    search = Search(simulator(clean_bench), told.append, known)
    assert search.round(search.calibrated()).winner is None
    search.close()
    assert not any("nominal values" in line for line in told)
