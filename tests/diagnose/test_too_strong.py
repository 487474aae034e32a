"""A law that is first tried so strongly that calibration absorbs all of it is tried once more.

The disc of `disc.py` behind a gearbox of ratio 2 and efficiency 1/2, which passes the torque on as
it is. A spring does the same on either side, but a usual one behind the gears holds the shaft, as
an inertia would; before them it may just let it move.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from cosim.calibrate.mapping import read_problem
from cosim.calibrate.problem import Problem
from cosim.diagnose import diagnose
from cosim.diagnose.candidates import candidates
from cosim.diagnose.search import Search
from cosim.diagnose.signature import Signature
from tests.diagnose import disc
from tests.problems import simulator

pytestmark = pytest.mark.slow

BEHIND, BEFORE = "load.flange", "gearbox.flange_a"
SYSTEM = """
description = "A disc behind a gearbox."
connections = [
  "gearbox.tau_b -> load.tau",
  "gearbox.J_b   -> load.J_added",
  "load.w        -> gearbox.w_b",
]
[instances]
gearbox = "gearbox/ratio"
load = "inertia/disc"
"""
GEARS = """
[parameters]
"gearbox.ratio" = 2.0
"gearbox.eta" = 0.5
"gearbox.b" = 0.0
"gearbox.J_a" = 0.0

[columns]"""
SPRING = 0.003
Traces = Callable[..., dict[str, Signature]]


def geared(folder: Path, law: disc.Law, seconds: float = 4.0) -> Problem:
    """The disc with a law behind the gears."""
    disc.write(folder, law, seconds=seconds)
    mapping = folder / "dataset.toml"
    text = mapping.read_text(encoding="utf-8").replace('"load.tau"', '"gearbox.tau_a"')
    mapping.write_text(text.replace("\n[columns]", GEARS, 1), encoding="utf-8")
    (folder / "system.toml").write_text(SYSTEM, encoding="utf-8")
    return read_problem(folder)


@pytest.fixture
def traces(tmp_path: Path) -> Iterator[Traces]:
    """What laws of one effect do to a disc with a spring, to first order, by their place."""
    searches = []

    def found(effect: str) -> dict[str, Signature]:
        problem = geared(tmp_path, lambda w, theta, t: SPRING * theta)
        only = [c for c in candidates(problem) if c.effect == effect]
        search = Search(simulator(problem, 1), only=only)
        searches.append(search)
        stage = search.scored(search.calibrated())
        return {s.candidate.place: s for s in stage.signatures}

    yield found
    for search in searches:
        search.close()


def test_a_spring_promises_the_same_on_either_side_of_the_gears(traces: Traces) -> None:
    found = traces("hose_spring")
    gains = [found[place].score.gain for place in (BEHIND, BEFORE)]
    assert min(gains) > 0.5 * max(gains) > 1e6


def test_what_calibration_absorbs_at_any_strength_promises_nothing(traces: Traces) -> None:
    """Viscous friction is the disc's own `b`."""
    found = traces("viscous")
    assert found and all(s.unseen for s in found.values())


def test_a_soft_spring_is_named_with_the_place_that_does_the_same(tmp_path: Path) -> None:
    found = diagnose(geared(tmp_path, lambda w, theta, t: SPRING * theta))
    assert found.verdict == "effect_found"
    ((name, places),) = found.answer.places.items()
    assert {name, *places} == {f"hose_spring at {BEFORE}", BEHIND} or {name, *places} == {
        f"hose_spring at {BEHIND}", BEFORE
    }  # fmt: skip
