"""A law's special case is fitted from where the law ended, whatever was held of it before."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cosim.calibrate.mapping import read_problem
from cosim.diagnose.candidates import candidates
from cosim.diagnose.completing import _held
from cosim.diagnose.composed import composed
from cosim.diagnose.models import GATE, Fitted
from cosim.diagnose.rivals import simplified
from cosim.diagnose.search import Search
from cosim.installation import places
from tests.diagnose import disc
from tests.problems import simulator

GENERAL, SPECIAL = "asymmetric_coulomb at load.flange", "coulomb at load.flange"
SHARP, USUAL = 2e-4, 2e-3
Begun = tuple[Search, Fitted]


@pytest.fixture(scope="module")
def begun(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[float], Begun]]:
    """A disc with friction of some asymmetry, and its fit with a friction of either direction."""
    searches = []

    def fitted(asymmetry: float) -> Begun:
        def law(w: float, theta: float, t: float) -> float:
            return 0.05 * (1.0 + math.copysign(asymmetry, w)) * math.tanh(w / USUAL)

        place = disc.write(tmp_path_factory.mktemp("disc"), law, seconds=2.0)
        problem = read_problem(place)
        both = [c for c in candidates(problem) if c.label in (GENERAL, SPECIAL)]
        search = Search(simulator(problem), only=both)
        searches.append(search)
        base = search.calibrated()
        stage = search.scored(base)
        item = next(s for s in stage.signatures if s.candidate.label == GENERAL)
        search.tried(base, stage, item, again=True)
        return search, search.sharpened(stage.fitted[0], base)

    yield fitted
    for search in searches:
        search.close()


@pytest.mark.parametrize("asymmetry", [0.0, 0.5])
def test_the_special_case_does_as_well_where_it_is_one(
    begun: Callable[[float], Begun], asymmetry: float
) -> None:
    search, general = begun(asymmetry)
    simplified(search, general, search.known)
    special = search.memo.get(frozenset({SPECIAL}))
    assert special is not None
    gain = search.better(special, general)
    # a parameter more is worth half a nat where it changes nothing
    assert (gain.fitted > GATE) == (gain.unused > GATE) == (asymmetry > 0.0)


def test_what_was_held_of_another_law_is_forgotten_and_of_its_own_kept(tmp_path: Path) -> None:
    problem = read_problem(disc.write(tmp_path, lambda w, theta, t: 0.0, seconds=1.0))
    laws = {c.effect: c for c in candidates(problem)}
    model = laws["stribeck"].added_to(laws["coulomb"].added_to(problem))
    held: Any = {
        f"load.flange.{name}": value
        for name, value in (("coulomb.w_0", SHARP), ("stribeck.w_0", SHARP), ("stribeck.w_s", 0.7))
    }
    fitted: Any = SimpleNamespace(problem=model.hold(held))
    less = composed(problem, fitted, [laws["stribeck"]])
    assert less.names == (*problem.names, "load.flange.stribeck.tau_s")
    assert less.constants["load.flange.stribeck.w_0"] == SHARP
    assert less.constants["load.flange.stribeck.w_s"] == 0.7
    again = laws["coulomb"].added_to(less)
    (smoothing,) = [p for p in again.parameters if p.name == "load.flange.coulomb.w_0"]
    assert smoothing.nominal == USUAL
    # held as a dead law, it would have come back as sharp as it was
    dead = fitted.problem.hold({"load.flange.coulomb.tau_c": 0.0})
    assert dead.constants["load.flange.coulomb.w_0"] == SHARP


def test_what_is_held_of_a_fidelity_is_known_as_its_own() -> None:
    """Its parameters are those of the component, whose names say nothing of the law."""
    problem = read_problem(places.scenarios() / "motor_bench" / "data" / "MB-12")
    (yielding,) = [c for c in candidates(problem) if c.label == "elastic at gearbox"]
    damping, value = "gearbox.elastic.d", 0.3
    model = yielding.added_to(problem).hold({damping: value})
    assert model.held == {damping: value} and model.constants["gearbox.d"] == value
    fitted: Any = SimpleNamespace(problem=model, effects=(yielding,))
    assert _held(fitted, SimpleNamespace(effects=(None,)))  # type: ignore[arg-type]
    again = composed(problem, fitted, [yielding])
    assert again.held == model.held and again.constants == model.constants
    assert composed(problem, fitted, []).held == {}
