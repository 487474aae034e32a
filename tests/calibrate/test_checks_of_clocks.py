"""Clocks, steps and periods of a data set that contradict each other."""

from __future__ import annotations

from dataclasses import replace

import pytest

from cosim.calibrate import Problem
from cosim.calibrate.checks.finding import NO_SOURCE, Finding
from cosim.calibrate.checks.times import check_times


def of_kind(problem: Problem, kind: str) -> list[Finding]:
    return [f for f in check_times(problem) if f.kind == kind]


@pytest.mark.parametrize(
    ("step", "search", "named", "way"),
    [
        (3e-4, 1e-3, "6.667", "step = 0.00025,"),
        (5e-4, 3e-4, "6.667", "search_step = 0.00025,"),
        (5e-4, 1e-3, "", ""),
        # rounded to the digits of a mapping; samples meet recorded points to a thousandth
        (2.857143e-4, 1e-3, "", ""),
    ],
)
def test_a_step_must_divide_the_period(
    noisy, step: float, search: float, named: str, way: str
) -> None:
    problem = noisy(0)
    problem = problem.changed(
        step=step, search=replace(problem.search, step=search), period=2e-3, source=NO_SOURCE
    )
    found = of_kind(problem, "step")
    assert [f.severity for f in found] == (["error"] if named else [])
    assert all(f"({named})" in f.text and way in f.text for f in found)
