"""A column in another unit in some runs only."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim.calibrate import Problem
from cosim.calibrate.checks.examine import check_model
from cosim.calibrate.checks.finding import Finding
from tests.problems import simulator


def units(problem: Problem) -> list[tuple[str, str, str]]:
    found: list[Finding] = check_model(simulator(problem))
    return [(f.run, f.column, f.severity) for f in found if f.kind == "unit"]


def changed(problem: Problem, column: str, factors: dict[str, float]) -> Problem:
    """The problem with a column of some runs in another unit."""
    index = [c.name for c in problem.channels].index(column)
    data = {name: problem.run(name).data.copy() for name in factors}
    for name, factor in factors.items():
        data[name][:, index] *= factor
    return problem.with_data(data)


@pytest.mark.parametrize("factor", [1e3, 180.0 / np.pi, -1e-3])
def test_one_run_in_another_unit_is_named(noisy, factor: float) -> None:
    assert units(noisy(0)) == []
    found = units(changed(noisy(0), "voltage", {"sines": factor}))
    assert found == [("sines", "voltage", "error")]


def test_of_two_runs_the_one_that_the_model_does_not_foretell_is_named(noisy) -> None:
    two = noisy(0).only(["sines", "stairs"])
    assert units(changed(two, "voltage", {"stairs": 1e3})) == [("stairs", "voltage", "error")]
    both = changed(two, "voltage", {"stairs": 1e3, "sines": 1e3})
    assert units(both) == [("", "voltage", "error")]
    assert units(two) == []


def test_a_run_that_is_larger_by_no_unit_is_the_machine(noisy) -> None:
    """Cold grease triples a current in one run."""
    assert units(changed(noisy(0), "current", {"stairs": 3.0})) == []


def test_a_factor_of_a_run_in_which_all_else_is_wrong_is_the_machine(noisy) -> None:
    problem = changed(noisy(0), "voltage", {"stairs": 1e3})
    names = [c.name for c in problem.channels]
    run = problem.run("stairs")
    data, random = run.data.copy(), np.random.default_rng(3)
    for name in ("speed", "current", "angle"):
        walk = np.cumsum(random.normal(size=len(data)))
        data[:, names.index(name)] = walk * problem.sigma[names.index(name)] * 10.0
    runs = [replace(r, data=data) if r.name == "stairs" else r for r in problem.runs]
    assert ("stairs", "voltage", "error") not in units(problem.changed(runs=runs))


@pytest.mark.parametrize(("factor", "named"), [(1e3, True), (30.0, False)])
def test_a_column_a_thousand_times_too_large_need_not_follow(
    noisy, factor: float, named: bool
) -> None:
    """A motor whose load has friction that the model lacks, its current in thousandths."""
    problem = noisy(0)
    index = [c.name for c in problem.channels].index("current")
    random = np.random.default_rng(4)
    data = {run.name: run.data.copy() for run in problem.runs}
    for values in data.values():
        values[:, index] = factor * np.std(values[:, index]) * random.standard_normal(len(values))
    assert units(problem.with_data(data)) == ([("", "current", "error")] if named else [])
