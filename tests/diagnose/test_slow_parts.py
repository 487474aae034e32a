"""A law that leaves next to noise, but slow parts, gives way to one that leaves noise."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim.calibrate.mapping import read_problem
from cosim.diagnose.candidates import candidates
from cosim.diagnose.models import Fitted
from cosim.diagnose.search import Search
from cosim.diagnose.second_look import without_slow_parts
from cosim.diagnose.whiteness import whiteness_tests
from tests.diagnose import disc
from tests.problems import simulator

DRAG, DRIFT = "quadratic_drag at load.flange", "temperature_drift at load.flange"
SIZE = 2e-6
"""Of the drag [N.m.s2/rad2]: a friction that drifts leaves hardly more than noise."""


def searched(folder: Path) -> tuple[Search, Fitted]:
    """A disc with drag, of which the catalogue has two laws; the calibrated model."""
    problem = read_problem(disc.write(folder, lambda w, theta, t: SIZE * w * abs(w)))
    known = [c for c in candidates(problem) if c.label in (DRAG, DRIFT)]
    search = Search(simulator(problem), only=known)
    base = search.calibrated()
    search.note(base)
    return search, base


@pytest.mark.parametrize("law", [DRIFT, DRAG])
def test_the_law_that_leaves_noise_stays(tmp_path: Path, law: str) -> None:
    search, base = searched(tmp_path / "disc")
    seen, alone = search.scored(base), search.scored(base, {law})
    search.rounds[:] = [seen]
    search.tried(base, alone, alone.signatures[0], again=False)
    (fitted,) = alone.fitted
    assert fitted.labels == {law} and not search.lacking(fitted)
    tests = whiteness_tests(search.fit_data - fitted.fit, search.fitting)
    assert any(t.slow_parts for t in tests) == (law == DRIFT)
    found = without_slow_parts(search, fitted)
    assert found.labels == {DRAG}
    assert (found is fitted) == (law == DRAG)
    assert search.rounds == [seen]
    search.close()
