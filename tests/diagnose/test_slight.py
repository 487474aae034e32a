"""What takes next to nothing of what is evidently missing is not added, nor varied."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pytest

from cosim.diagnose.course import slight
from cosim.diagnose.models import Fitted
from cosim.diagnose.rounds import Round
from cosim.diagnose.together import Draft, _better
from tests.diagnose import built
from tests.diagnose.built import Rig

WEIGHT, FRICTION, DRAG = 0.02, 0.002, 5e-5
"""Laws of the catalogue that a disc has: of an unbalance, friction [N.m], drag [N.m.s2/rad2]."""
HIDDEN = 0.008
"""Of a law that no catalogue has [N.m]."""


def laws(w: float, theta: float, t: float) -> float:
    return WEIGHT * math.sin(theta) + FRICTION * math.tanh(w / 0.01) + DRAG * w * abs(w)


def evident(w: float, theta: float, t: float) -> float:
    return laws(w, theta, t) + HIDDEN * math.sin(25.0 * t)


@pytest.fixture(scope="module")
def lacking(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """A disc with laws, one of which no model has."""
    with built.rig(tmp_path_factory.mktemp("disc"), evident) as rig:
        yield rig


def further(rig: Rig, base: Fitted, effect: str) -> Fitted:
    """A model with one of the laws more."""
    values = {"unbalance": ("m_u", WEIGHT), "coulomb": ("tau_c", FRICTION),
              "quadratic_drag": ("c", DRAG)}  # fmt: skip
    name, value = values[effect]
    return rig.search.sharpened(rig.added(base, effect, {name: value}), base)


def beyond(fitted: Fitted) -> float:
    """What a model leaves beyond noise [nats]."""
    return fitted.estimate.robust - 0.5 * fitted.estimate.count


def asked(rig: Rig, base: Fitted, effect: str) -> tuple[bool, float, list[str]]:
    """Whether a further law is slight, which share it takes of what is left, and what is said."""
    said: list[str] = []
    winner = further(rig, base, effect)
    stage = Round(base, [], {}, fitted=[winner], winner=winner)
    rig.search.say, before = said.append, rig.search.say
    found = slight(rig.search, stage)
    rig.search.say = before
    return found, rig.search.gain(base, winner) / beyond(base), said


def test_a_further_law_must_take_a_tenth_of_what_is_evidently_missing(lacking: Rig) -> None:
    base = further(lacking, lacking.base, "unbalance")
    little, share, said = asked(lacking, base, "quadratic_drag")
    assert little and share < 0.05
    assert said[0].startswith("not added: quadratic_drag at load.flange, ")
    assert said[0].endswith(" % of what is left")
    little, share, said = asked(lacking, base, "coulomb")
    assert not little and share > 0.15 and not said


def test_a_noise_that_is_off_by_a_few_per_cent_is_no_missing_law(tmp_path: Path) -> None:
    def hidden(w: float, theta: float, t: float) -> float:
        return laws(w, theta, t) - DRAG * w * abs(w) + 0.4 * HIDDEN * math.sin(25.0 * t)

    with built.rig(tmp_path, hidden) as rig:
        base = further(rig, further(rig, rig.base, "unbalance"), "coulomb")
        little, share, said = asked(rig, base, "quadratic_drag")
    assert 0.0 < beyond(base) < 0.1 * base.estimate.count and share < 0.1
    assert not little and not said


def test_where_runs_turn_unstable_little_is_enough(tmp_path: Path) -> None:
    """Moments that come too early are most of what is left there."""
    with built.rig(tmp_path, evident, unstable=True) as rig:
        little, share, said = asked(rig, further(rig, rig.base, "unbalance"), "quadratic_drag")
    assert share < 0.05 and not little and not said


def test_a_larger_set_must_take_a_tenth_of_what_smaller_ones_leave(lacking: Rig) -> None:
    """And do better than all of them; the smallest, than the declared model."""
    search, declared = lacking.search, lacking.base

    def draft(*effects: str) -> Draft:
        model = declared
        for effect in effects:
            model = further(lacking, model, effect)
        return Draft(model, model.problem, {})

    alone = draft("unbalance")
    assert _better(search, declared, alone, [])
    assert not _better(search, declared, draft("quadratic_drag"), [])
    assert _better(search, declared, draft("unbalance", "coulomb"), [alone])
    assert not _better(search, declared, draft("unbalance", "quadratic_drag"), [alone])
    assert not _better(search, declared, draft("coulomb"), [alone])


def test_a_larger_set_must_do_better_in_unused_runs_too(tmp_path: Path) -> None:
    def brake(w: float, theta: float, t: float) -> float:
        return WEIGHT * math.sin(theta) + FRICTION * math.tanh(w / 0.01)

    def pushed(w: float, theta: float, t: float) -> float:
        return brake(w, theta, t) - 3.0 * FRICTION * math.tanh(w / 0.01)

    with built.rig(tmp_path, {"sweep": brake, "steps": brake, "check": pushed}) as rig:
        alone = further(rig, rig.base, "unbalance")
        both = further(rig, alone, "coulomb")
        assert rig.search.gain(alone, both) > 0.5 * beyond(alone) > 5.0
        drafts = [Draft(f, f.problem, {}) for f in (alone, both)]
        assert not _better(rig.search, rig.base, drafts[1], drafts[:1])
