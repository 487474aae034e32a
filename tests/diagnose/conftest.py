"""A motor bench of the independent plant that lacks nothing."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from benchmarks.motor_plant import draw, write_sets
from cosim.calibrate.mapping import read_problem
from cosim.calibrate.problem import Problem
from tests.problems import simulator

SHEET = Path(__file__).parents[2] / "scenarios/motor_bench/data/motor_bench.toml"


@pytest.fixture(scope="module")
def clean_bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Problem]:
    """A short data set without undeclared effects."""
    folder = tmp_path_factory.mktemp("benches")
    (place,) = write_sets(folder, [draw(np.random.default_rng(3))], SHEET, 5, 2.0, ("ST", "MS"))
    problem = read_problem(place)
    yield problem
    simulator(problem).close()
