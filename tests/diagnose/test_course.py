"""What is dear is asked where a law took less than half of what is missing, not before."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from cosim.diagnose import Diagnosis
from cosim.diagnose.answer import Verdict
from cosim.diagnose.candidates import candidates
from cosim.diagnose.course import Course, share
from cosim.diagnose.models import Fitted
from cosim.diagnose.rounds import Round
from cosim.diagnose.search import Search
from tests.diagnose import built, disc
from tests.problems import simulator

DRAG, WEIGHT, HIDDEN = 0.01, 0.2, 2.0
"""Of drag [N.m.s2/rad2], an unbalance, and a push that no catalogue has [N.m]."""
LIGHT = 2e-3
"""Of either, so small that a fit from near is at its minimum."""
ASKED = ("quadratic_drag", "unbalance", "coulomb")


def two(w: float, theta: float, t: float) -> float:
    return WEIGHT * math.sin(theta) + DRAG * w * abs(w)


def pushed(w: float, theta: float, t: float) -> float:
    return two(w, theta, t) + HIDDEN * math.sin(9.0 * t)


def light(w: float, theta: float, t: float) -> float:
    return LIGHT * (math.sin(theta) + w * abs(w))


def followed(
    folder: Path, law: disc.Law, monkeypatch: pytest.MonkeyPatch
) -> tuple[Search, Fitted, list[int]]:
    """A search, what it ends with, and after how many rounds sets were asked."""
    asked: list[int] = []
    problem = built.problem(folder, law, seconds=4.0)
    chosen = [c for c in candidates(problem) if c.place == built.FLANGE and c.effect in ASKED]
    search = Search(simulator(problem), only=chosen)
    base = search.calibrated()
    search.note(base)

    def noted(result: Diagnosis, current: Fitted) -> Fitted:
        asked.append(len(search.rounds))
        return current

    monkeypatch.setattr("cosim.diagnose.course.proposed_set", noted)
    result = Diagnosis(search.raw, Verdict(""), search=search, before=base)
    current = Course(result, search, base).followed()
    search.close()
    return search, current, asked


def test_a_second_law_is_asked_before_sets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    search, current, asked = followed(tmp_path, two, monkeypatch)
    first = search.rounds[0]
    assert first.winner is not None
    assert first.open and share(search, first) > 0.5
    assert {e.effect for e in current.effects} == {"unbalance", "quadratic_drag"}
    assert not asked


def test_sets_are_asked_where_a_law_takes_less_than_half(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    search, _, asked = followed(tmp_path, pushed, monkeypatch)
    first = search.rounds[0]
    assert first.winner is None or share(search, first) < 0.5
    assert asked[0] == 1


def test_what_a_law_takes_is_a_share_of_what_is_beyond_noise(tmp_path: Path) -> None:
    with built.rig(tmp_path, two, seconds=4.0) as rig:
        one = rig.added(rig.base, "unbalance", {"m_u": WEIGHT})
        both = rig.added(one, "quadratic_drag", {"c": DRAG})
        shares = [
            share(rig.search, Round(rig.base, [], {}, fitted=[law], winner=law))
            for law in (one, both)
        ]
    assert 0.5 < shares[0] < 0.99
    # noise is a thousandth of what is missing
    assert shares[1] == pytest.approx(1.0, abs=0.01)


def test_a_law_after_runs_were_ended_is_not_compared_with_fits_of_whole_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first law's rivals have had their turn, and their fits are longer than what is left."""
    until = 100
    with built.rig(tmp_path, light, unstable=True) as rig:
        search = rig.search
        names = {*search.fitting.names, *search.checking.names}
        ended = iter([dict.fromkeys(names, until), {}])
        monkeypatch.setattr("cosim.diagnose.course.ends", lambda *model: next(ended))
        drag = rig.added(rig.base, "quadratic_drag", {"c": LIGHT})
        other = rig.added(rig.base, "bearing_drag", {"tau_ref": 1e-3})
        first = Round(rig.base, [], {}, fitted=[drag, other], winner=drag,
                      near=frozenset(other.effects))  # fmt: skip
        course = Course(
            Diagnosis(search.raw, Verdict(""), search=search, before=rig.base), search, rig.base
        )
        course.proposed = True
        assert course._added(first)
        assert {run.times.size for run in search.raw.runs} == {until}
        both = rig.added(course.current, "unbalance", {"m_u": LIGHT, "psi": 0.0})
        assert not search.lacking(both)
        course._added(Round(course.current, [], {}, fitted=[both], winner=both))
    assert {e.effect for e in course.current.effects} == {"quadratic_drag", "unbalance"}
