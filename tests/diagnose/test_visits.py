"""Places that a run comes by."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate import Problem, read_problem
from cosim.diagnose.visits import visited
from sources.packaging.catalog import candidates
from tests.problems import simulator

DATA = Path(__file__).resolve().parents[2] / "scenarios" / "motor_bench" / "data" / "MB-12"


@pytest.fixture(scope="module")
def bench() -> Problem:
    """The committed data set."""
    problem = read_problem(DATA)
    return problem.changed(step=problem.search.step)


def test_the_first_points_span_the_path(bench: Problem) -> None:
    run = bench.runs[0]
    names = ("load.angle", "load.w")
    points = visited(simulator(bench), bench.nominal, [run], names, 6)
    many = visited(simulator(bench), bench.nominal, [run], names, 200)
    assert points.shape == (6, 2)
    assert np.array_equal(many[:6], points)
    # each one is farther from those before it than any later one is from all of them
    gaps = [
        float(np.min(np.linalg.norm(many[:k] - many[k], axis=1))) for k in range(1, many.shape[0])
    ]
    assert all(a >= b for a, b in pairwise(gaps))


def test_a_system_without_the_variable_has_no_such_places(bench: Problem) -> None:
    found = visited(
        simulator(bench), bench.nominal, [bench.runs[0]], ("load.angle", "load.nowhere"), 6
    )
    assert found.shape == (0, 2)


def test_what_lies_on_the_floor_meets_every_wheel_that_comes_there() -> None:
    found = {(effect, place) for effect, place, _ in candidates("mobile_base/planar")}
    places = {place for effect, place in found if effect == "low_friction_patch"}
    assert places == {"drive_wheel.mu", "caster.mu"}
    assert {("pivot_torque", "caster.floor"), ("pivot_torque", "caster_fl.floor")} <= found
