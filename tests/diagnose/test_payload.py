"""A mass somewhere on a base, of which the place must be found, too."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from cosim.calibrate import read_problem
from cosim.diagnose.candidates import candidates
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
