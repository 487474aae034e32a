"""Sets of laws along the log's motion are fitted where they do most of what is missing there."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from cosim.diagnose.candidates import candidates
from cosim.diagnose.localise import everywhere
from cosim.diagnose.search import Search
from cosim.diagnose.together import together
from tests.diagnose import built, disc
from tests.problems import simulator

ASKED = ("quadratic_drag", "coulomb")


def known(w: float, theta: float, t: float) -> float:
    return 0.05 * math.tanh(w / 2e-3) + 0.002 * w * abs(w)


def foreign(w: float, theta: float, t: float) -> float:
    """Of a frequency that none of the runs has."""
    return 0.5 * math.sin(23.0 * t)


@pytest.mark.parametrize("law", [known, foreign])
def test_sets_that_do_less_than_half_are_not_fitted(tmp_path: Path, law: disc.Law) -> None:
    problem = built.problem(tmp_path, law, seconds=3.0)
    others = {c.effect for c in candidates(problem)} - set(ASKED)
    said: list[str] = []
    search = Search(simulator(problem), said.append, without=others)
    try:
        base = search.calibrated()
        search.note(base)
        found = together(search, base, everywhere(search, base))
        refused = "no 4 laws explain half of that: first orders would mislead" in said
        assert any(text.startswith("along the log by efforts") for text in said)
        assert refused == (law is foreign)
        if law is foreign:
            assert found is base and len(list(search.memo)) == 1
        else:
            assert {f"{name} at load.flange" for name in ASKED} == found.labels
            assert not search.lacking(found)
    finally:
        search.close()
