"""A law is named if the data determine it, a further effect if the model needs it.

On discs whose laws are written out; the models are those that the diagnosis makes of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from cosim.diagnose.candidates import Candidate
from cosim.diagnose.established import examined, freed, needed, settle, told_from_absence
from cosim.diagnose.models import GATE, Fitted
from cosim.diagnose.rounds import Round
from cosim.diagnose.verdict import TENTH
from tests.diagnose import built
from tests.diagnose.built import Rig

USUAL = 2e-3
"""Speed over which the laws of the catalogue smooth a sign [rad/s]."""
DRY = 0.01
"""Friction [N.m]: what it does is ten times the noise."""
WEIGHT = 0.02
"""Of an unbalance [N.m] so small that the declared model is not far off."""


def friction(w: float, theta: float, t: float) -> float:
    return DRY * math.tanh(w / USUAL)


def one_way(w: float, theta: float, t: float) -> float:
    """Friction in forward motion only, as `asymmetric_coulomb` usually is."""
    return 2.0 * friction(max(w, 0.0), theta, t)


def weight(w: float, theta: float, t: float) -> float:
    return WEIGHT * math.sin(theta + 0.5)


@pytest.fixture(scope="module")
def dry(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """A disc with dry friction and nothing else."""
    with built.rig(tmp_path_factory.mktemp("dry"), friction) as rig:
        yield rig


# -- laws of which only a simpler one shows --------------------------------------------------------


def friction_laws(rig: Rig, asymmetry: float) -> tuple[Fitted, Fitted]:
    """Friction that may differ between the directions, by so much to begin with, and plain one."""
    either = rig.added(rig.base, "asymmetric_coulomb", {"tau_c": DRY, "a": asymmetry})
    return either, rig.added(rig.base, "coulomb", {"tau_c": DRY})


def test_a_bristle_of_which_only_friction_shows_is_that(tmp_path: Path) -> None:
    """And its rivals are compared: they were fitted while the other law had won."""

    def law(w: float, theta: float, t: float) -> float:
        return friction(w, theta, t) + 0.006 * math.sin(theta)

    with built.rig(tmp_path, law) as rig:
        bristle = rig.added(rig.base, "bristle", {"tau_c": DRY, "x_0": 5e-4}, held={"r": 0.0})
        coulomb = rig.added(rig.base, "coulomb", {"tau_c": DRY, "w_0": USUAL})
        other = rig.added(rig.base, "unbalance", {"m_u": 0.006})
        near = frozenset({other.effects[-1]})
        fits = [bristle, coulomb, other]
        stage = Round(rig.base, [], {}, fitted=fits, winner=bristle, near=near)
        settle(rig.search, rig.base, stage)
    assert stage.winner is not None and stage.winner.labels == {"coulomb at load.flange"}
    assert any(f is stage.winner for f in stage.fitted)
    said, compared = rig.said[-2:]
    assert said == "bristle at load.flange: nothing of it but coulomb shows"
    assert compared.startswith("unbalance at load.flange instead: -")


def test_parameters_that_undo_its_strength_are_held_once_intervals_are_known(
    tmp_path: Path,
) -> None:
    """A draft may have taken both as known: of this drag one shows."""

    def law(w: float, theta: float, t: float) -> float:
        return 0.05 * math.copysign((abs(w) / 10.0) ** (2.0 / 3.0), w)

    with built.rig(tmp_path, law) as rig:
        drag = rig.added(
            rig.base, "bearing_drag", {"tau_ref": 0.05, "w_ref": 10.0}, held={"w_ref": 9.0}
        )
        stage = Round(rig.base, [], {}, fitted=[drag], winner=drag)
        settle(rig.search, rig.base, stage)
    assert stage.winner is not None and stage.winner.labels == drag.labels
    assert stage.winner.problem.names == ("J", "b", "load.flange.bearing_drag.tau_ref")
    assert stage.winner.estimate.identifiable.all()


def test_parameters_that_a_draft_has_refused_are_asked_for_again(tmp_path: Path) -> None:
    """A weight of which only the size was fitted stands where it is wanted then."""
    with built.rig(tmp_path, weight) as rig:
        plain = rig.added(rig.base, "unbalance", {"m_u": WEIGHT})
        stage = Round(rig.base, [], {}, fitted=[plain], winner=plain)
        settle(rig.search, rig.base, stage)
    assert stage.winner is not None and stage.winner.labels == plain.labels
    found = stage.winner.estimate.values
    assert found["load.flange.unbalance.psi"] == pytest.approx(0.5, abs=0.05)
    assert found["load.flange.unbalance.m_u"] == pytest.approx(WEIGHT, rel=0.05)


def test_a_law_that_the_data_determine_stays(dry: Rig) -> None:
    """That friction is the same in both directions is known, not open."""
    either, coulomb = friction_laws(dry, 0.5)
    asymmetry = either.estimate.values["load.flange.asymmetric_coulomb.a"]
    assert asymmetry == pytest.approx(0.0, abs=0.2)  # three of its standard deviations
    assert dry.search.total(dry.base, coulomb) > 0.999 * dry.search.total(dry.base, either)
    stage = Round(dry.base, [], {}, fitted=[either, coulomb], winner=either)
    settle(dry.search, dry.base, stage)
    assert stage.winner is either


def test_a_law_that_does_better_than_the_simpler_one_stays(tmp_path: Path) -> None:
    def strong(w: float, theta: float, t: float) -> float:
        return 8.0 * one_way(w, theta, t)

    with built.rig(tmp_path, strong) as rig:
        either, coulomb = friction_laws(rig, 1.0)
        assert rig.search.accepted(rig.base, coulomb)
        stage = Round(rig.base, [], {}, fitted=[either, coulomb], winner=either)
        settle(rig.search, rig.base, stage)
    assert stage.winner is either


def test_a_law_with_more_parameters_that_were_held_is_no_simpler_one(dry: Rig) -> None:
    """Friction with its smoothing free is not one of either direction, taken as the same."""
    coulomb = dry.search.sharpened(
        dry.added(dry.base, "coulomb", {"tau_c": DRY, "w_0": USUAL}), dry.base
    )
    either = dry.added(dry.base, "asymmetric_coulomb", {"tau_c": DRY})
    assert not coulomb.estimate.identifiable[-1] and either.complexity < coulomb.complexity
    stage = Round(dry.base, [], {}, fitted=[coulomb, either], winner=coulomb)
    settle(dry.search, dry.base, stage)
    assert stage.winner is coulomb


# -- further effects where runs may turn unstable --------------------------------------------------


def little(w: float, theta: float, t: float) -> float:
    """Some friction beside what no law explains."""
    return weight(w, theta, t) + 0.002 * math.tanh(w / 0.01) + 0.005 * math.sin(9.0 * t)


def both(w: float, theta: float, t: float) -> float:
    return weight(w, theta, t) + 0.004 * math.tanh(w / 0.01)


def further(rig: Rig, effect: str, **values: float) -> tuple[Fitted, Fitted]:
    """A model with an unbalance, and with a further effect."""
    quick = rig.added(rig.base, "unbalance", {"m_u": WEIGHT, "psi": 0.4})
    base = rig.search.sharpened(quick, rig.base)
    return base, rig.added(base, effect, values)


def asked(rig: Rig, base: Fitted, winner: Fitted) -> Round:
    """A round that found a further effect, which has been asked."""
    stage = Round(base, [], {}, fitted=[winner], winner=winner)
    needed(rig.search, base, stage)
    return stage


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """A disc with an unbalance and friction, whose start angles may decide."""
    with built.rig(tmp_path_factory.mktemp("two"), both, unstable=True) as rig:
        yield rig


def test_a_further_effect_that_the_model_needs_stays(two: Rig) -> None:
    base, winner = further(two, "coulomb", tau_c=0.01)
    stage = asked(two, base, winner)
    assert stage.winner is winner and stage.base is base


def test_one_that_explains_little_of_what_is_left_does_not(tmp_path: Path) -> None:
    with built.rig(tmp_path, little, unstable=True) as rig:
        base, winner = further(rig, "coulomb", tau_c=0.002)
        assert winner.gate is not None and winner.gate.passed
        assert rig.search.gain(base, winner) > 20.0
        stage = asked(rig, base, winner)
    assert stage.winner is None and stage.base is base
    assert rig.said[-1].startswith("coulomb at load.flange is not needed: ")


def test_one_that_unused_runs_do_not_want_does_not(tmp_path: Path) -> None:
    laws = {"sweep": both, "steps": both, "check": weight}
    with built.rig(tmp_path, laws, unstable=True) as rig:
        base, winner = further(rig, "coulomb", tau_c=0.01)
        beyond = base.estimate.robust - 0.5 * base.estimate.count
        assert rig.search.gain(base, winner) > 0.5 * beyond
        stage = asked(rig, base, winner)
    assert stage.winner is None and stage.base is base


def test_one_that_came_with_better_start_values_leaves_them(tmp_path: Path) -> None:
    """The model without it is better than the one that the round began with."""
    with built.rig(tmp_path, weight, unstable=True, angle=0.03) as rig:
        base, winner = further(rig, "quadratic_drag", c=1e-4)
        winner = rig.search.released(winner, base)
        gain = rig.search.gain(base, winner)
        stage = asked(rig, base, winner)
        assert rig.search.gain(base, stage.base) == pytest.approx(gain, abs=5.0) and gain > 100.0
    assert stage.winner is None and stage.base.labels == base.labels
    starts = [run.starts["load.angle"] for run in stage.base.problem.runs]
    assert starts == [pytest.approx(0.03, abs=2e-3)] * 3
    assert stage.base.signature is base.signature
    assert stage.base.gate == base.gate


def test_one_without_which_nothing_can_be_simulated_stays(two: Rig) -> None:
    base, winner = further(two, "coulomb", tau_c=0.01)
    usual = two.search.simulator
    two.search.simulator = usual.limited({run.name: 1.0 for run in two.search.raw.runs})
    try:
        stage = asked(two, base, winner)
    finally:
        two.search.simulator = usual
    assert stage.winner is winner and stage.base is base
    assert two.said[-1].startswith("without coulomb at load.flange: ")


def test_first_effects_and_calm_systems_are_not_asked(two: Rig, dry: Rig) -> None:
    """Neither is a wrong one taken back, nor is anything simulated."""
    wrong = two.added(two.base, "quadratic_drag", {"c": 1e-4}, fit=False)
    first = dry.added(dry.base, "coulomb", {"tau_c": DRY})
    beside = dry.added(first, "quadratic_drag", {"c": 1e-4}, fit=False)
    for rig, base, winner in ((two, two.base, wrong), (dry, first, beside)):
        before = rig.search.evaluations
        assert asked(rig, base, winner).winner is winner
        assert rig.search.evaluations == before


# -- parameters that do the work of a further effect -----------------------------------------------


def parted(rig: Rig, effect: str, **values: float) -> tuple[Fitted, Fitted]:
    """A model with friction one way and a further effect, and without the second one."""
    first = rig.added(rig.base, "asymmetric_coulomb", {"tau_c": DRY})
    whole = rig.added(first, effect, values)
    return rig.search.without(whole, whole.effects[-1]), whole


def test_a_law_beside_another_gives_way_to_all_parameters_of_that_one(tmp_path: Path) -> None:
    """Friction one way and friction both ways are friction that differs between the two."""

    def law(w: float, theta: float, t: float) -> float:
        return one_way(w, theta, t) + friction(w, theta, t)

    with built.rig(tmp_path, law) as rig:
        less, whole = parted(rig, "coulomb", tau_c=DRY)
        assert rig.search.gain(less, whole) > GATE  # it would be added
        found = freed(rig.search, less, whole)
        assert rig.search.gain(whole, found) == pytest.approx(0.0, abs=2.0)
    assert found.effects == less.effects and found.signature is less.signature
    values = {n.rpartition(".")[2]: v for n, v in found.estimate.values.items()}
    assert values["a"] == pytest.approx(0.5, abs=0.2)
    assert values["tau_c"] == pytest.approx(2.0 * DRY, rel=0.1)
    assert rig.said[-1].endswith(" instead of a further effect")


def test_parameters_that_bring_nothing_stay_held(tmp_path: Path) -> None:
    with built.rig(tmp_path, one_way) as rig:
        less, whole = parted(rig, "unbalance", m_u=WEIGHT)
        assert freed(rig.search, less, whole) is less


def test_a_law_without_such_parameters_is_not_fitted_again(dry: Rig) -> None:
    less = dry.added(dry.base, "quadratic_drag", {"c": 1e-4}, fit=False)
    whole = dry.added(less, "coulomb", {"tau_c": DRY})
    before = dry.search.evaluations
    assert freed(dry.search, less, whole) is less and dry.search.evaluations == before


def test_a_law_that_stands_on_another_is_not_asked_alone(dry: Rig) -> None:
    """A stiffening spring acts on a shaft that yields; a disc alone has no spring."""
    spring = Candidate("load", "disc", "cubic_stiffness", "spring")
    less = replace(dry.base, effects=(spring,))
    assert freed(dry.search, less, less) is less
    assert dry.said[-1].startswith("cubic_stiffness at load.spring alone: ")


# -- intervals that hold absence on the other side of a bend ------------------------------------


def as_if_open(fitted: Fitted) -> Fitted:
    """A fit whose strength's interval is as wide below as it is open above."""
    assert fitted.signature is not None
    place = fitted.problem.index(fitted.signature.strength.name)
    estimate = fitted.estimate
    low, known = estimate.low.copy(), estimate.identifiable.copy()
    low[place], known[place] = 0.0, False
    return replace(fitted, estimate=replace(estimate, low=low, identifiable=known))


def test_a_strength_whose_tenth_the_data_refuse_is_there(dry: Rig) -> None:
    winner = as_if_open(dry.added(dry.base, "coulomb", {"tau_c": DRY}))
    assert not dry.search.law(winner, winner.effects[-1]).there
    found = told_from_absence(dry.search, dry.base, winner, winner.effects[-1])
    law = dry.search.law(found, found.effects[-1])
    assert law.there and law.size.low == pytest.approx(TENTH * law.size.value)
    assert law.size.high == dry.search.law(winner, winner.effects[-1]).size.high
    assert "refused by the data" in dry.said[-1]
    known = dry.search.memo.get(found.labels)
    assert known is not None and dry.search.law(known, known.effects[-1]).there


def test_one_whose_tenth_does_as_well_may_be_absent(dry: Rig) -> None:
    """A drag that is not there: nothing is refused, nothing is said."""
    winner = as_if_open(dry.added(dry.base, "quadratic_drag", {"c": 1e-6}))
    said = list(dry.said)
    assert told_from_absence(dry.search, dry.base, winner, winner.effects[-1]) is winner
    assert dry.said == said


def test_a_strength_that_the_data_determine_is_not_asked(dry: Rig) -> None:
    winner = dry.added(dry.base, "coulomb", {"tau_c": DRY})
    assert told_from_absence(dry.search, dry.base, winner, winner.effects[-1]) is winner


def test_so_is_each_of_several_laws_when_they_are_fitted_anew(tmp_path: Path) -> None:
    """Else a law that the data need would be dropped beside another one."""

    def law(w: float, theta: float, t: float) -> float:
        return friction(w, theta, t) + WEIGHT * math.sin(theta)

    with built.rig(tmp_path, law) as rig:
        first = rig.added(rig.base, "unbalance", {"m_u": WEIGHT})
        whole = rig.added(first, "coulomb", {"tau_c": DRY})
        place = whole.problem.index("load.flange.unbalance.m_u")
        low, known = whole.estimate.low.copy(), whole.estimate.identifiable.copy()
        low[place], known[place] = 0.0, False
        even = replace(whole, estimate=replace(whole.estimate, low=low, identifiable=known))
        assert not rig.search.law(even, even.effects[0]).there
        found = examined(rig.search, even, 2)
        assert found.labels == whole.labels
        assert all(rig.search.law(found, effect).there for effect in found.effects)
