"""A set that leaves more than noise is asked for anew beside each of its laws."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from cosim.calibrate.budget import StoppedError
from cosim.calibrate.mapping import read_problem
from cosim.diagnose import diagnose
from cosim.diagnose.anew import asked_anew
from cosim.diagnose.candidates import candidates
from cosim.diagnose.models import Fitted
from cosim.diagnose.search import Search
from tests.diagnose import disc
from tests.problems import simulator

WEIGHT, DRAG, DRIFT = (
    f"{law} at load.flange" for law in ("unbalance", "quadratic_drag", "temperature_drift")
)
KNOWN = (WEIGHT, DRAG, DRIFT)


def law(w: float, theta: float, t: float) -> float:
    return 2e-3 * w * abs(w) + 0.05 * math.sin(theta + 0.5)


def added(search: Search, base: Fitted, label: str) -> Fitted:
    """A model with a further law, though others would do better."""
    stage = search.scored(base, {label})
    search.tried(base, stage, stage.signatures[0], again=False)
    return search.sharpened(stage.fitted[0], base)


@pytest.mark.parametrize("second", [DRIFT, DRAG])
def test_a_law_chosen_beside_another_gives_way_to_a_better_one(tmp_path: Path, second: str) -> None:
    problem = read_problem(disc.write(tmp_path, law))
    known = [c for c in candidates(problem) if c.label in KNOWN]
    search = Search(simulator(problem), only=known)
    try:
        base = search.calibrated()
        search.note(base)
        added(search, base, second)
        proposed = added(search, added(search, base, WEIGHT), second)
        assert proposed.labels == {WEIGHT, second}
        assert search.lacking(proposed) == (second == DRIFT)
        better = asked_anew(search, proposed)
        if second == DRAG:
            assert better is None
        else:
            assert better is not None and {WEIGHT, DRAG} <= better.labels
            assert not search.lacking(better)
            assert search.rounds[-1].base.labels == {WEIGHT}  # beside the law that is missed most
        begun = [stage.base.labels for stage in search.rounds]
        assert len(set(begun)) == len(begun)
        if second == DRAG:  # beside each, and beside both; then all have been
            assert set(begun) == {frozenset({WEIGHT}), frozenset({DRAG}), proposed.labels}
            assert asked_anew(search, proposed) is None
            assert [stage.base.labels for stage in search.rounds] == begun
    finally:
        search.close()


def test_a_set_is_not_named_if_the_search_is_stopped_while_it_is_asked_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The verdict that it had before was still to be challenged."""
    asked: list[str] = []

    def stopped(search: Search, proposed: Fitted) -> None:
        asked.append(f"asked beside {len(proposed.effects)}")
        raise StoppedError("by the test")

    monkeypatch.setattr("cosim.diagnose.diagnosis.leaves_more", lambda search, fitted: True)
    monkeypatch.setattr("cosim.diagnose.diagnosis.asked_anew", stopped)
    found = diagnose(read_problem(disc.write(tmp_path, lambda w, theta, t: 2e-3 * w * abs(w))))
    assert asked == ["asked beside 1"]
    assert found.verdict == "unexplained" and not found.answer.laws
    assert found.answer.stopped == "by the test" and found.answer.hints
