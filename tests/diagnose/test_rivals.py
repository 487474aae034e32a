"""An early choice gives way to a rival that the last model shows to be better, and stays if not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.bench import Bench
from benchmarks.motor_plant import draw, write_sets
from benchmarks.own_plant import catalogue, example, made
from cosim.calibrate.mapping import read_problem
from cosim.diagnose.candidates import candidates
from cosim.diagnose.models import Fitted
from cosim.diagnose.rivals import challenged, reconsidered
from cosim.diagnose.rounds import Round
from cosim.diagnose.search import Search
from tests.problems import simulator

pytestmark = pytest.mark.slow

EXAMPLE = Path(__file__).parents[2] / "scenarios/motor_bench/data/MB-12"
SHEET = Path(__file__).parents[2] / "scenarios/motor_bench/data/motor_bench.toml"
RIGHT, WRONG = "coulomb at load.flange", "bearing_drag at load.flange"


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Search, Round]]:
    """A round over dry friction, which is there, and a bearing drag, which is not."""
    folder = tmp_path_factory.mktemp("benches")
    bench = Bench(draw(np.random.default_rng(3)).parameters, "coulomb", 0.4)
    (place,) = write_sets(folder, [bench], SHEET, 5, 2.0, ("ST", "MS", "LW"))
    problem = read_problem(place)
    search = Search(
        simulator(problem), only=[c for c in candidates(problem) if c.label in (RIGHT, WRONG)]
    )
    base = search.calibrated()
    found = search.scored(base)
    for item in found.signatures:
        search.tried(base, found, item, again=False)
    found.open = True
    yield search, found
    search.close()


def fitted(stage: Round, label: str) -> Fitted:
    """The fit of a candidate."""
    return next(f for f in stage.fitted if f.effects[-1].label == label)


def test_a_wrong_choice_is_exchanged(stage: tuple[Search, Round]) -> None:
    search, found = stage
    found.winner = fitted(found, WRONG)
    last = reconsidered(search, found.winner, [found])
    assert [e.label for e in last.effects] == [RIGHT]
    assert found.winner is not None and found.winner.effects[-1].label == RIGHT
    assert last.estimate.values["load.flange.coulomb.tau_c"] == pytest.approx(0.4, rel=0.1)
    assert not any(RIGHT in p for p in last.problem.constants)


def test_the_right_choice_stays(stage: tuple[Search, Round]) -> None:
    search, found = stage
    found.winner = fitted(found, RIGHT)
    assert reconsidered(search, found.winner, [found]) is found.winner


def test_a_round_that_decided_is_not_reconsidered(stage: tuple[Search, Round]) -> None:
    search, found = stage
    found.winner, found.open, found.compared = fitted(found, WRONG), False, frozenset()
    try:
        assert reconsidered(search, found.winner, [found]) is found.winner
    finally:
        found.open = True


def test_it_is_where_a_later_effect_has_joined(stage: tuple[Search, Round]) -> None:
    """Once for each set of effects."""
    search, found = stage
    wrong = fitted(found, WRONG)
    later = replace(wrong.effects[-1], effect="unbalance")  # absent: nothing of it is fitted
    both = replace(wrong, effects=(*wrong.effects, later))
    found.winner, found.open, found.compared = wrong, False, frozenset()
    try:
        last = reconsidered(search, both, [found])
        assert RIGHT in [e.label for e in last.effects]
        assert found.compared == frozenset(last.effects)
        assert reconsidered(search, last, [found]) is last
    finally:
        found.open, found.compared = True, frozenset()


@pytest.mark.parametrize("known_before", [True, False])
@pytest.mark.parametrize("truth", ["coulomb", "asymmetric_coulomb"])
def test_a_simpler_law_is_named_where_it_does_as_well(truth: str, known_before: bool) -> None:
    """Whether it was fitted before or its score was too poor for that."""
    rig = example(EXAMPLE, 3.0)
    labels = ("coulomb at load.flange", "asymmetric_coulomb at load.flange")
    known = [c for c in catalogue(rig) if c.label in labels]
    (item,) = [c for c in known if c.effect == truth]
    search = Search(simulator(made(rig, item, 1.0, 7).problem), only=known)
    base = search.calibrated()
    stage = search.scored(base)
    for signature in stage.signatures:
        search.tried(base, stage, signature, again=False)
    stage.winner = search.refined(base, fitted(stage, labels[1]))
    simple = fitted(stage, labels[0])
    assert stage.winner.complexity > simple.complexity
    stage.fitted = [simple, stage.winner] if known_before else [stage.winner]
    if not known_before:
        stage.signatures = [s for s in stage.signatures if s.candidate.label != labels[0]]
    found = challenged(search, base, stage)
    search.close()
    assert found.effects[-1].effect == truth
    assert any(f is found for f in stage.fitted)
