"""A spike where a command switches at the same sample, which other columns show, too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim.calibrate import Problem
from cosim.calibrate.checks.finding import Finding
from cosim.calibrate.checks.spiking import check_spikes
from tests.problems import simulator

SWITCH = 250
"""Sample at which the command of the run `stairs` takes its first step."""


def struck(problem: Problem, column: str, at: int, size: float) -> Problem:
    """One sample of the run `stairs` is off by so many deviations."""
    index = [c.name for c in problem.channels].index(column)
    data = problem.run("stairs").data.copy()
    data[at, index] += size * problem.sigma[index]
    return problem.with_data({"stairs": data})


def found(problem: Problem, off: float = 1.0) -> list[Finding]:
    """Spikes against a model whose columns are so many times what is measured."""
    nominal = problem.nominal
    sim = simulator(problem)
    models = {run.name: off * sim.simulate(nominal, run) for run in problem.runs}
    return list(check_spikes(problem, models))


@pytest.mark.parametrize("at", [SWITCH, SWITCH + 60])
def test_a_spike_is_found_wherever_the_command_switches(noisy, at: int) -> None:
    spikes = found(struck(noisy(0), "angle", at, 1000.0))
    assert [(f.run, f.column, f.severity) for f in spikes] == [("stairs", "angle", "error")]
    assert f"the first at {1e-3 * at:g} s" in spikes[0].text


def test_the_model_s_size_does_not_matter_there(noisy) -> None:
    """Parameters are not known yet."""
    problem = struck(noisy(0), "angle", SWITCH, 1000.0)
    assert [f.column for f in found(problem, 0.7)] == ["angle"]


def test_what_the_command_itself_may_strike_is_no_fault(noisy) -> None:
    """The current answers the command at once, and a jolt of the machine may come of it."""
    assert found(struck(noisy(0), "current", SWITCH + 1, 40.0)) == []


def test_a_jolt_that_the_model_lacks_is_no_fault_where_the_command_switches(noisy) -> None:
    """Speed and angle jump at the end of a play: more than what the model has there."""
    problem = struck(noisy(0), "angle", SWITCH, 1000.0)
    index = [c.name for c in problem.channels].index("speed")
    run = problem.run("stairs")
    data = run.data.copy()
    data[SWITCH:, index] += (
        20.0 * problem.sigma[index] * np.exp(-np.arange(len(data) - SWITCH) / 50.0)
    )
    runs = [replace(r, data=data) if r.name == "stairs" else r for r in problem.runs]
    assert found(problem.changed(runs=runs)) == []


@pytest.mark.parametrize("size", [1, 40])
def test_steps_of_one_count_are_no_spikes(noisy, size: int) -> None:
    """The twin stands out by many counts."""
    problem = noisy(0)
    index = [c.name for c in problem.channels].index("speed")
    count = 10.0 * problem.sigma[index]
    run = problem.run("stairs")
    data = run.data.copy()
    data[:, index] = count * np.rint(data[:, index] / count)
    at = next(k for k in range(50, len(data)) if np.ptp(data[k - 40 : k + 40, index]) == 0.0)
    data[at, index] += size * count
    told = found(problem.changed(runs=[replace(run, data=data)]))
    assert ("spikes" in {f.kind for f in told}) == (size > 1)
    assert f"give quantum = {count:.6g} in [channels]" in told[0].text
