"""Damage of logs by itself: parts written twice, counts set back, stray commands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from cosim.calibrate import Problem
from cosim.calibrate.checks.examine import check_data
from cosim.calibrate.checks.finding import Finding
from cosim.calibrate.checks.jumps import check_jumps
from cosim.data.signals import Table
from tests.problems import simulator

AT = 800


def of_kind(findings: list[Finding], kind: str) -> list[tuple[str, str, str]]:
    return [(f.severity, f.run, f.column) for f in findings if f.kind == kind]


@pytest.mark.parametrize(("size", "named"), [(100, True), (0, False)])
def test_a_part_of_a_run_that_was_written_twice(noisy, size: int, named: bool) -> None:
    problem: Problem = noisy(0)
    run = problem.run("stairs")
    data = run.data.copy()
    data[AT : AT + size] = data[AT - size : AT]
    found = check_data(problem.with_data({"stairs": data}))
    assert of_kind(found, "copy") == [("error", "stairs", "")] * named


def test_a_motion_that_a_machine_repeats_is_not_written_twice(noisy) -> None:
    """Its noise is another one each time."""
    problem: Problem = noisy(0)
    run = problem.run("stairs")
    exact = np.tile(simulator(problem).simulate(problem.nominal, run)[:AT], (3, 1))
    again = exact[: len(run.data)]
    again = again + problem.sigma * np.random.default_rng(4).standard_normal(again.shape)
    assert of_kind(check_data(problem.with_data({"stairs": again})), "copy") == []


def jumps(problem: Problem, change: Callable[[np.ndarray], np.ndarray]) -> list[Finding]:
    """In the angle of the run `stairs`."""
    models = {r.name: simulator(problem).simulate(problem.nominal, r) for r in problem.runs}
    index = [c.name for c in problem.channels].index("angle")
    data = problem.run("stairs").data.copy()
    data[:, index] = change(data[:, index])
    return list(check_jumps(problem.with_data({"stairs": data}), models))


def moved(angle: np.ndarray, by: float) -> np.ndarray:
    return angle + by * (np.arange(angle.size) > AT)


def test_an_angle_that_is_set_back_and_one_that_goes_on_elsewhere(noisy) -> None:
    problem: Problem = noisy(0)
    found = jumps(problem, lambda angle: moved(angle, angle[0] - angle[AT + 1]))
    assert of_kind(found, "jump") == [("error", "stairs", "angle")]
    assert "set back to where it began" in found[0].text
    found = jumps(problem, lambda angle: moved(angle, 50.0))
    assert of_kind(found, "jump") == [("warning", "stairs", "angle")]
    assert "after 0.8 s" in found[0].text


def test_what_moves_fast_or_comes_back_has_not_jumped(noisy) -> None:
    problem: Problem = noisy(0)
    assert jumps(problem, lambda angle: angle) == []
    assert jumps(problem, lambda angle: angle + 50.0 * (np.arange(angle.size) == AT)) == []
    lost = jumps(problem, lambda angle: np.where(np.arange(angle.size) // 20 == 40, np.nan, angle))
    assert lost == []


@pytest.mark.parametrize(
    ("size", "rows", "named"), [(30.0, 1, True), (30.0, 9, False), (2.0, 1, False)]
)
def test_a_single_command_far_outside_of_the_others(
    noisy, size: float, rows: int, named: bool
) -> None:
    """A blow of several samples, or of the size of others, is meant."""
    problem: Problem = noisy(0)
    run = problem.run("stairs")
    ((target, table),) = run.inputs.items()
    times = run.times
    values = np.asarray(table.at(times)).copy()
    values[AT : AT + rows] = size * np.max(np.abs(values))
    stray = Table(times, values, interpolation="hold", text="stairs:speed_set")
    changed = problem.changed(
        runs=[replace(r, inputs={target: stray}) if r.name == "stairs" else r for r in problem.runs]
    )
    assert of_kind(check_data(changed), "spikes") == [("warning", "stairs", "speed_set")] * named
