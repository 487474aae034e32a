"""Rounds go on where a model leaves noise: a law too small to be missed hides in the others."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from cosim.calibrate.mapping import read_problem
from cosim.diagnose import Diagnosis, diagnose
from cosim.diagnose.answer import Verdict
from cosim.diagnose.candidates import candidates
from cosim.diagnose.course import Course
from cosim.diagnose.established import examined
from cosim.diagnose.search import Search
from tests.diagnose import disc
from tests.problems import simulator

DRAG, DRIFT = "quadratic_drag at load.flange", "temperature_drift at load.flange"
WEIGHT = "unbalance at load.flange"
SLIGHT, LARGE = 2e-6, 2e-3
"""Of drags [N.m.s2/rad2]: beside the first a friction that drifts leaves hardly more than noise."""
LIGHT = 1e-4
"""Of an unbalance [N.m] beside the large drag: left out, no channel is above 1.1 of its noise."""


@pytest.mark.parametrize("law", [DRIFT, DRAG])
def test_a_law_that_nearly_does_gives_way_to_the_right_one(tmp_path: Path, law: str) -> None:
    problem = read_problem(disc.write(tmp_path, lambda w, theta, t: SLIGHT * w * abs(w)))
    known = [c for c in candidates(problem) if c.label in (DRAG, DRIFT)]
    search = Search(simulator(problem), only=known)
    base = search.calibrated()
    search.note(base)
    alone = search.scored(base, {law})
    search.tried(base, alone, alone.signatures[0], again=False)
    (fitted,) = alone.fitted
    assert fitted.labels == {law} and not search.lacking(fitted)
    result = Diagnosis(search.raw, Verdict(""), search=search, before=base)
    found = examined(search, Course(result, search, fitted).followed(), len(known))
    search.close()
    assert found.labels == {DRAG}
    assert (found is fitted) == (law == DRAG)


@pytest.mark.parametrize("size", [LIGHT, 0.0])
def test_a_small_law_beside_a_large_one_is_named_if_it_is_there(
    tmp_path: Path, size: float
) -> None:
    folder = disc.write(
        tmp_path, lambda w, theta, t: LARGE * w * abs(w) + size * math.sin(theta + 0.5)
    )
    found = diagnose(read_problem(folder), law=False)
    assert found.verdict == "effect_found"
    assert {law.label for law in found.answer.laws} == ({DRAG, WEIGHT} if size else {DRAG})
    assert found.after is not None
    estimate = found.after.estimate
    # the interval is one of 95 %, and this seed is one of the other 5 % or not: five deviations
    for name, truth in {"J": disc.J, "b": disc.B}.items():
        i = found.after.problem.index(name)
        half = 0.5 * (estimate.high[i] - estimate.low[i])
        assert estimate.values[name] == pytest.approx(truth, abs=2.5 * half)
    model = next(m for m in found.table.models if m.labels == {DRAG})
    assert not [x for x in model.left if x.lasting > 1.1]
