"""A rival that lacks only what its law holds is fitted with it; where that brings nothing, not."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from cosim.diagnose.candidates import candidates
from cosim.diagnose.completing import COMPLETED, completed, freed
from cosim.diagnose.judge import OFF
from cosim.diagnose.late_values import LateValueFitter
from cosim.diagnose.models import Fitted
from cosim.diagnose.rivals import nearly
from cosim.diagnose.rounds import Round
from cosim.diagnose.search import CHECK
from cosim.spec.hints import SearchHints
from tests.diagnose import built, disc, plants
from tests.problems import simulator

STIFFNESS, REST = 0.3, 2.0
"""A hose [N.m/rad] that hangs free far from where the disc begins [rad]."""


def pulled(w: float, theta: float, t: float) -> float:
    return STIFFNESS * (theta - REST)


def dragging(w: float, theta: float, t: float) -> float:
    return 0.2 * w * abs(w)


def stage(rig: built.Rig) -> Round:
    """A round that drag has won, with a hose that hangs free at 0 next to it."""
    winner = rig.added(rig.base, "quadratic_drag", {"c": 0.01})
    rival = rig.added(rig.base, "hose_spring", {"k": 0.1})
    found = Round(rig.base, [], {}, fitted=[winner, rival], winner=winner, open=True)
    found.near = frozenset(f.effects[-1] for f in found.fitted)
    return found


def name(fitted: Fitted | None) -> str:
    assert fitted is not None
    return fitted.effects[-1].effect


@pytest.mark.parametrize(("law", "last"), [(pulled, "hose_spring"), (dragging, "quadratic_drag")])
def test_a_rival_is_judged_with_the_parameters_of_its_law(
    tmp_path: Path, law: disc.Law, last: str
) -> None:
    with built.rig(tmp_path, law) as rig:
        found = stage(rig)
        before = found.winner
        completed(rig.search, rig.base, found)
        assert name(found.winner) == last
        if last == "hose_spring":
            assert found.winner is not None
            values = found.winner.estimate.values
            assert values["load.flange.hose_spring.theta_0"] == pytest.approx(REST, rel=0.01)
            assert not found.open and any("does better with its other" in s for s in rig.said)
        else:
            assert found.winner is before and found.open


def test_one_that_only_fitted_runs_want_is_completed(tmp_path: Path) -> None:
    """Unused runs speak of a law once nothing of it is held."""
    with built.rig(tmp_path, pulled) as rig:
        found = stage(rig)
        found.near = frozenset({found.fitted[0].effects[-1]})
        completed(rig.search, rig.base, found)
        assert name(found.winner) == "hose_spring"


def test_rivals_that_are_far_or_hold_nothing_are_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with built.rig(tmp_path, pulled) as rig:
        found = stage(rig)
        before, fits = found.winner, list(found.fitted)
        found.near = frozenset({before.effects[-1]}) if before is not None else frozenset()
        monkeypatch.setattr("cosim.diagnose.completing.NEARLY", 1.01)  # not even the best
        completed(rig.search, rig.base, found)
        assert found.winner is before and found.fitted == fits
        viscous = rig.added(rig.base, "viscous", {"b": 0.1})  # all that it has is fitted
        found.fitted.append(viscous)
        found.near |= {viscous.effects[-1]}
        completed(rig.search, rig.base, found)
        assert found.winner is before and viscous in found.fitted


def test_no_more_of_them_than_a_few(tmp_path: Path) -> None:
    with built.rig(tmp_path, pulled) as rig:
        found = stage(rig)
        rival = found.fitted[1]
        others = [rig.added(rig.base, effect, {size: 0.1}, fit=False)
                  for effect, size in (("coulomb", "tau_c"), ("bristle", "tau_c"))]  # fmt: skip
        assert len(others) == COMPLETED
        found.fitted[1:1] = others
        found.near |= {f.effects[-1] for f in others}
        completed(rig.search, rig.base, found)
        assert rival in found.fitted  # not fitted again


def test_a_law_at_one_of_a_few_places_is_near_if_it_promised_to_be(tmp_path: Path) -> None:
    judge = LateValueFitter(simulator(plants.base_on_casters(tmp_path)), CHECK, lambda text: None)
    base = plants.leaving(judge, 100.0)
    known = {c.label: c for c in candidates(judge.raw)}
    shift, load = known["load_shift at base.load"], known["payload at base.body"]
    best = plants.fitted(judge, base, shift, 1000.0)
    held = plants.fitted(judge, base, load, 500.0)  # where it was tried
    best.signature = plants.gaining(judge, shift, 1000.0)
    assert held.signature is not None
    place = f"{load.prefix}position[1]"
    for promised, fixed, near in ((900.0, {place: 0.2}, True), (700.0, {place: 0.2}, False),
                                  (900.0, {}, False)):  # fmt: skip
        score = plants.gaining(judge, load, promised).score
        held.signature = replace(held.signature, score=score, fixed=fixed)
        stage = Round(base, [], {}, fitted=[best, held], quick=1000.0)
        assert nearly(judge, base, stage) == frozenset({shift, load} if near else {shift})


def test_one_that_still_leaves_more_keeps_all_its_parameters(tmp_path: Path) -> None:
    def law(w: float, theta: float, t: float) -> float:
        return pulled(w, theta, t) + 0.05 * math.sin(5.0 * t)

    with built.rig(tmp_path, law) as rig:
        found = stage(rig)
        completed(rig.search, rig.base, found)
        assert name(found.winner) == "hose_spring" and found.open
        assert found.winner is not None and found.winner in found.fitted
        values = found.winner.estimate.values
        assert values["load.flange.hose_spring.theta_0"] == pytest.approx(REST, rel=0.1)


def at_a_place(rig: built.Rig) -> tuple[Round, Fitted]:
    """A round, and a quick fit of a hose that was tried hanging free at two angles."""
    rival = rig.added(rig.base, "hose_spring", {"k": 0.1}, fit=False)
    item = rival.signature
    assert item is not None
    tried = SearchHints(tries=(0.0, 1.0))
    others = tuple(replace(p, hints=tried) for p in item.probe.others)
    rest = {f"{item.candidate.prefix}theta_0": 0.0}
    rival.signature = replace(item, probe=replace(item.probe, others=others), fixed=rest)
    assert rival.signature.placed
    return Round(rig.base, [], {}), rival


def test_far_off_a_law_that_was_tried_at_a_few_places_is_fitted_with_its_place(
    tmp_path: Path,
) -> None:
    with built.rig(tmp_path, pulled) as rig:
        found, rival = at_a_place(rig)
        assert rig.search.typical(rig.base) > OFF
        values = freed(rig.search, found, rival).estimate.values
        assert values["load.flange.hose_spring.theta_0"] == pytest.approx(REST, rel=0.01)


def test_near_the_noise_or_without_a_place_or_after_others_a_quick_fit_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with built.rig(tmp_path, pulled) as rig:
        found, rival = at_a_place(rig)
        found.fitted = [rival] * COMPLETED
        assert freed(rig.search, found, rival) is rival
        found.fitted = []
        drag = rig.added(rig.base, "quadratic_drag", {"c": 0.01}, fit=False)
        assert freed(rig.search, found, drag) is drag
        monkeypatch.setattr("cosim.diagnose.completing.OFF", rig.search.typical(rig.base) + 1.0)
        assert freed(rig.search, found, rival) is rival
