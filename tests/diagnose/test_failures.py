"""What cannot be simulated is said, and ends no search that has found something."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from cosim.calibrate.mapping import read_problem
from cosim.calibrate.problem import Problem
from cosim.diagnose.candidates import candidates
from cosim.diagnose.diagnosis import diagnose
from cosim.diagnose.fitter import Fitter
from cosim.diagnose.models import Fitted
from cosim.diagnose.rounds import Round
from cosim.diagnose.search import Search
from cosim.diagnose.secant import Bench
from cosim.errors import CosimError
from tests.diagnose.disc import write
from tests.problems import simulator

Vector = NDArray[np.float64]
DRAG, DRY = "quadratic_drag at load.flange", "coulomb at load.flange"


@pytest.fixture(scope="module")
def problem(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    """A disc with dry friction that nobody has declared."""
    folder = tmp_path_factory.mktemp("disc")
    return read_problem(write(folder, lambda w, theta, t: 0.05 * float(np.tanh(w / 2e-3))))


def test_candidates_that_cannot_be_simulated_are_named(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulated = Bench.at

    def at(self: Bench, changed: Problem, values: Mapping[str, float]) -> Vector:
        if any("quadratic_drag" in name for name in values):
            raise CosimError("run stopped at t = 1 s: a reason\nand more of it")
        return simulated(self, changed, values)

    monkeypatch.setattr(Bench, "at", at)
    said: list[str] = []
    chosen = [c for c in candidates(problem) if c.label in (DRAG, DRY)]
    search = Search(simulator(problem), said.append, only=chosen)
    found = search.scored(search.calibrated())
    search.close()
    assert set(found.failed) == {DRAG}
    assert [s.candidate.label for s in found.signatures] == [DRY]
    text = (
        f"not asked, since they cannot be simulated: {DRAG}; the first: run stopped at t = 1 s: a"
    )
    assert found.unasked.startswith(text) and "more of it" not in found.unasked
    assert found.unasked in said


def test_candidates_that_cannot_be_simulated_in_all_runs_are_named(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One run may choose candidates, and another be too much for them."""
    simulated = Bench.at
    chosen = [c for c in candidates(problem) if c.label in (DRAG, DRY)]
    search = Search(simulator(problem), only=chosen)
    base = search.calibrated()
    assert search.telling(base) is not search.fitting

    def at(self: Bench, changed: Problem, values: Mapping[str, float]) -> Vector:
        if self.stack is search.fitting and any("coulomb" in name for name in values):
            raise CosimError("run stopped at t = 2 s")
        return simulated(self, changed, values)

    monkeypatch.setattr(Bench, "at", at)
    found = search.scored(base)
    search.close()
    assert found.failed == {DRY: "run stopped at t = 2 s"}
    assert DRY not in {s.candidate.label for s in found.signatures}


def test_what_nothing_is_asked_of_can_be_simulated(problem: Problem) -> None:
    """Of a delay that was tried far too long less than a tick may be wanted: no failure."""
    chosen = [c for c in candidates(problem) if c.label in (DRAG, DRY)]
    search = Search(simulator(problem), only=chosen)
    base = search.calibrated()
    bench = search.bench(base, search.fitting)
    trials = bench.begun(chosen)
    search.close()
    assert len(trials) == 2
    for one in trials:
        one.best, one.going = None, False
        one.error = "run stopped" * (one.probe.candidate.label == DRAG)
    assert bench.followed(trials) == []
    assert bench.failed == {DRAG: "run stopped"}


def test_a_model_that_is_unstable_around_nominal_values_ends_nothing(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A round without a winner asks there once more, if parameters stand at their bounds."""
    monkeypatch.setattr(Fitter, "far", lambda self, fitted: True)

    def fit(*args: object, **kwargs: object) -> Fitted:
        raise CosimError("unstable")

    search = Search(simulator(problem), only=[])
    base = search.calibrated()
    monkeypatch.setattr("cosim.diagnose.fitter.fit", fit)
    said: list[str] = []
    search.say = said.append
    assert search.unfitted(base) is None
    assert search.round(base).winner is None
    search.close()
    assert said.count("nothing around nominal values: unstable") == 2


def test_a_round_that_fails_leaves_what_others_have_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Dry friction beside a spring: whichever comes first, the other one is missed."""
    law = lambda w, theta, t: 0.05 * float(np.tanh(w / 2e-3)) + 0.02 * theta  # noqa: E731
    problem = read_problem(write(tmp_path, law, seconds=2.0))
    scored = Search.scored

    def once(self: Search, base: Fitted, among: object = None) -> Round:
        if base.effects:
            raise CosimError("a step failed")
        return scored(self, base)

    monkeypatch.setattr(Search, "scored", once)
    # sets along the log would find both at once
    monkeypatch.setattr("cosim.diagnose.course.proposed_set", lambda result, current: current)
    result = diagnose(problem, workers=1, law=False)
    for said in ("no further effect was looked for", "laws were not asked for anew"):
        assert f"{said}: a step failed" in result.warnings
    assert any(model.laws and not model.rough for model in result.table.models)
    assert result.verdict
