"""A mass somewhere on a base, of which the place must be found, too."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.arm_question import write
from cosim.calibrate import read_problem
from cosim.diagnose.candidates import candidates
from cosim.diagnose.search import Search
from sources.effects.payload import POSITION
from tests.problems import simulator

DATA = Path(__file__).resolve().parents[2] / "scenarios" / "omni_bench" / "data" / "OB-06"
MASS = 20.0
"""[kg]"""


@pytest.mark.slow
def test_a_place_shows_on_either_side_only_where_there_is_a_mass() -> None:
    problem = read_problem(DATA)
    circle = next(run for run in problem.runs if run.name == "CIR")
    (payload,) = (c for c in candidates(problem) if c.effect == "payload")
    loaded = payload.added_to(problem.changed(runs=[replace(circle)]))
    simulated = simulator(loaded)

    def change(mass: float, x: float) -> NDArray[np.float64]:
        theta = loaded.nominal
        theta[loaded.index(f"{payload.prefix}mass")] = mass
        theta[loaded.index(f"{payload.prefix}position[1]")] = x
        ((_, rows),) = simulated.residuals(theta)
        return np.asarray(np.nan_to_num(rows))

    none, middle = change(0.0, 0.0), change(MASS, 0.0)
    low, high = POSITION.hints.tries
    assert np.array_equal(none, change(0.0, high))  # no derivative leads to it
    left, right = change(MASS, low) - middle, change(MASS, high) - middle
    # about linear: the wrong side is refused and the right one explains what a start needs
    alike = np.sum(left * right) / np.sqrt(np.sum(left**2) * np.sum(right**2))
    assert alike < -0.9


@pytest.mark.slow
def test_a_shift_of_the_load_is_compared_with_a_payload_whose_place_is_fitted(
    tmp_path: Path,
) -> None:
    """Tried along one axis alone, its place would tell it from a shift that does the same."""
    names = ("load_shift at base.load", "payload at base.body")
    write(tmp_path, {names[1]: 8.0}, 22)
    problem = read_problem(tmp_path).only(["IN1", "CN1", "CN2"])
    search = Search(simulator(problem), only=[c for c in candidates(problem) if c.label in names])
    search.round(search.calibrated())
    search.close()
    shift, payload = (search.memo.get(frozenset([name])) for name in names)
    assert shift is not None and payload is not None
    assert payload.signature is not None and payload.signature.placed
    assert not shift.signature.placed
    assert payload.gate is not None  # judged on unused runs, too, once what is redundant is held
    assert not search.apart(shift, payload)
