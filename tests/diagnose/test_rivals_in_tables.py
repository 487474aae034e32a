"""Rivals in tables of models: many of them, special cases in sets, and laws that are one."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.diagnose.facts import Comparison, Gain, Law, Model, Table, Value
from cosim.diagnose.linear import score
from cosim.diagnose.models import LEVEL
from cosim.diagnose.power import POWER, power
from cosim.diagnose.rounds import Round
from cosim.diagnose.table import comparable
from cosim.diagnose.verdict import decide
from tests.diagnose import built
from tests.diagnose.test_verdict import COUNT, FAR, law, model, table

NOTHING = Gain(0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("count", [0, 10, 12, 20])
def test_sets_without_a_name_do_not_keep_rivals_from_being_compared(count: int) -> None:
    """Three laws each, better by a little, of which none was left out to see what it is without."""
    named = [FAR, model(law("coulomb")), model(law("delay", "gearbox.flange_a"))]
    sets = []
    for number in range(count):
        three = [law("coulomb", "load.flange"), law("cogging"), law(f"viscous_{number}")]
        one = model(*(replace(item, missed=None) for item in three), gain=30.0)
        sets.append(replace(one, gain=Gain(1000.0, 500.0, 20.0, 20.0, 3.0)))
    whole = table(*named, *sets)
    assert {1, 2} <= set(comparable(whole))
    found = decide(replace(whole, comparisons=(Comparison(1, 2, NOTHING),)))
    assert found.kind == "confounded"


@pytest.mark.parametrize("beside", [True, False])
def test_a_special_case_counts_by_its_own_law_also_beside_a_large_one(beside: bool) -> None:
    """Symmetric friction is 1000 nats worse in fitted and in unused runs, of a million."""
    noise = -0.5 * COUNT
    bound = Value("a", "1", 1.0, 0.9, 1.0, -1.0, 1.0, True)
    general = law("asymmetric_coulomb", fitted=1500.0, gain=1500.0, own=2, extra=(bound,),
                  contains=("coulomb",))  # fmt: skip
    special = law("coulomb", fitted=500.0, gain=500.0)
    large = (law("cogging", fitted=5e5, gain=5e5),) if beside else ()

    def one(laws: tuple[Law, ...], likelihood: float, free: int) -> Model:
        gain = Gain(likelihood + 6e5, likelihood + 6e5, 50.0, 50.0, 9.0) if laws else None
        return replace(model(*laws, rms=1.0 if laws else 16.0), fitted=likelihood,
                       unused=likelihood, free=free, gain=gain)  # fmt: skip

    models = (
        one((), noise - 1500.0 - 5e5 * beside, 9), one((*large, general), noise, 12),
        one((*large, special), noise - 1000.0, 11),
    )  # fmt: skip
    worse = Comparison(1, 2, Gain(-1000.0, -1000.0, -30.0, -30.0, 1.0))
    found = decide(replace(table(*models), comparisons=(worse,)))
    assert found.kind == "effect_found"
    assert {item.effect for item in found.laws} == {general.effect, *(x.effect for x in large)}


def test_what_is_one_with_a_rival_is_told_with_it() -> None:
    """Also if it was not fitted: it may be what is there."""
    rival = law("bias", "log.m", twins=("coulomb at gearbox.flange_a",))
    rivals: Table = table(FAR, model(law("gain", "log.m")), model(rival), alike=((1, 2),))
    found = decide(rivals)
    assert found.kind == "confounded"
    assert found.others == (("bias at log.m",), ("coulomb at gearbox.flange_a",))
    assert "coulomb at gearbox.flange_a" in found.reason
    assert [item["effects"] for item in found.to_dict()["alternatives"]] == [
        ["bias at log.m"], ["coulomb at gearbox.flange_a"],
    ]  # fmt: skip


def test_what_is_told_to_be_detectable_is_detected_as_often_as_told(tmp_path: Path) -> None:
    """Scores of few blocks have the tails of Student's t, and of laws with a phase another law."""
    with built.rig(tmp_path, lambda w, theta, t: 0.0, seconds=4.0) as rig:
        rig.search.known = [rig.candidate(e) for e in ("quadratic_drag", "unbalance")]
        found, stack = rig.search.scored(rig.base), rig.search.fitting
    random = np.random.default_rng(1)
    freedom, tests, seen = 10, 100, []
    for item in found.signatures:
        change = item.rest.astype(np.float64)
        for _ in range(50):  # each promise is made from one noise, and kept in others
            drawn = score(change, random.standard_normal(stack.size), stack, freedom)
            one = Round(found.base, [replace(item, score=drawn)], {}, ("another",) * (tests - 1))
            told = power(one, stack)[item.candidate.label]["smallest_detectable"]
            for _ in range(10):
                residual = random.standard_normal(stack.size) + change * told / abs(item.value)
                got = score(change, residual, stack, freedom)
                chance = np.exp(-0.5 * got.z**2) if item.probe.mix else got.p_value
                seen.append(chance * tests < LEVEL)
    assert np.mean(seen) == pytest.approx(POWER, abs=0.1)


def test_what_is_told_to_be_detectable_was_simulated_about_as_weak(tmp_path: Path) -> None:
    """Friction that holds the disc is as good as inertia, and of much viscosity curvature is left.

    The weak friction shows all the same, and weak viscosity is the declared one.
    """
    friction, viscosity = "coulomb at load.flange", "viscous at load.flange"
    with built.rig(tmp_path / "none", lambda w, theta, t: 0.0, seconds=4.0) as rig:
        rig.search.known = [rig.candidate(e) for e in ("coulomb", "viscous")]
        found, stack = rig.search.scored(rig.base), rig.search.fitting
        strong = {s.candidate.label: s.value for s in found.signatures}
        told = power(found, stack, rig.search.bench(rig.base, stack))
    size = told[friction]["smallest_detectable"]
    assert size < 0.001 * strong[friction]
    assert "extrapolated_from" not in told[friction]
    assert told[viscosity]["smallest_detectable"] is None
    assert "absorbs" in told[viscosity]["reason"]
    with built.rig(tmp_path / "some", lambda w, theta, t: 2.0 * size * math.tanh(w / 0.002),
                   seconds=4.0) as rig:  # fmt: skip
        rig.search.known = [rig.candidate(e) for e in ("coulomb", "viscous")]
        corrected = rig.search.scored(rig.base).corrected
    assert corrected[friction] < LEVEL < corrected[viscosity]


@pytest.mark.parametrize(
    ("late", "more", "kind"),
    [
        (3e-4, 40.0, "nothing_missing"),  # read within a tick; the other law imitates that
        (3e-4, 5.0, "effect_found"),  # no better: the other law may be there
        (6e-4, 40.0, "effect_found"),  # a law itself
        (3e-4, -500.0, "effect_found"),  # small beside the other law
    ],
)
def test_what_imitates_a_shift_within_a_tick_has_no_name(
    late: float, more: float, kind: str
) -> None:
    """A wheel's speed is read 0.3 ms late, which a clock that loses 0.5 ms in a run nearly does."""
    skew = law("clock_skew", "log.speed", value=2e-5, half=2e-6, gain=60.0, tick=1.5e-5)
    shift = law("delay", "log.speed", value=late, half=1e-4, gain=60.0 + more, tick=5e-4)
    sets = model(skew, gain=60.0), model(shift, gain=60.0 + more)
    found = decide(table(model(), *sets))
    assert found.kind == kind
    if kind == "effect_found":
        assert [x.effect for x in found.laws] == ["delay" if late > 5e-4 else "clock_skew"]


@pytest.mark.parametrize("real", [True, False])
def test_beside_a_law_a_shift_within_a_tick_takes_no_name_from_it(real: bool) -> None:
    friction = law("coulomb", "motor.shaft")
    skew = law("clock_skew", "log.speed", value=2e-5, half=2e-6, gain=60.0, tick=1.5e-5)
    shift = law("delay", "log.speed", value=3e-4, half=1e-4, gain=100.0, tick=5e-4)
    sets = model(friction), model(friction, skew, gain=60.0), model(friction, shift, gain=140.0)
    found = decide(table(FAR, *(sets if real else sets[:2])))
    assert found.kind == "effect_found"
    assert [x.effect for x in found.laws] == ["coulomb", *(["clock_skew"] if not real else [])]
