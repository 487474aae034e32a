"""The coarser way to run a system in a search: where it holds, how near it is, what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate import Problem, read_problem
from cosim.calibrate.parts import Coarse
from cosim.errors import ScenarioError, UnknownNameError
from tests.problems import simulator


def test_settings_hold_at_the_search_step_only_and_stay_near(short: Problem, truth) -> None:
    run = short.runs[0]
    coarse = Coarse(5e-4, {"extrapolation": 1}, {"motor.T_current": 2.5e-4})
    problem = short.changed(search=coarse)
    exact = simulator(short).simulate(truth, run)
    np.testing.assert_array_equal(simulator(problem).simulate(truth, run), exact)
    assert problem.system().members["motor"].parameters["T_current"] == 5e-5  # the rig's
    quick = problem.changed(step=coarse.step)
    assert simulator(quick).session(run).master.options == {"extrapolation": 1}
    assert quick.system().members["motor"].parameters["T_current"] == 2.5e-4
    changed = simulator(quick).simulate(truth, run)
    # a current loop five times slower and a torque without the delay of a tick: below the noise
    difference = np.sqrt(np.mean((changed - exact) ** 2, axis=0)) / short.sigma
    assert np.all(difference < 1.0) and np.max(difference) > 0.0
    for item in (problem, quick):
        simulator(item).close()


def test_unknown_names_in_search_parameters_are_refused(short: Problem) -> None:
    wrong = short.changed(step=5e-4, search=Coarse(5e-4, {}, {"motor.T_curent": 2.5e-4}))
    with pytest.raises(UnknownNameError, match="T_curent"):
        wrong.system()


@pytest.mark.parametrize(
    ("lines", "text"),
    [
        (
            "tick = 1e-3\nsearch_step = 2e-3\n[search.option]\nextrapolation = 1",
            "has no key 'option'",
        ),
        ("search_step = 2e-3\n[search.options]\nextrapolation = 1", "the rig's tick"),
        ("tick = 1e-3\n[search.options]\nextrapolation = 1", "search_step other than step"),
        ("tick = 1.5e-3", "tick = 0.0015 s is no whole number of steps of 0.001 s"),
        ("tick = 5e-4", "tick = 0.0005 s is no whole number of steps of 0.001 s"),
        ("ticks = true", "has no key 'ticks'"),
    ],
)
def test_faults_of_a_search_are_named(tmp_path: Path, lines: str, text: str) -> None:
    (tmp_path / "dataset.toml").write_text(
        f"""system = "motor_bench"
step = 1e-3
{lines}
[inputs]
"motor.w_ref" = "command"
[channels.current]
signal = "motor.i_measured"
sigma = 0.1
unit = "A"
[[parameter]]
name = "R_a"
nominal = 0.25
min = 0.2
max = 0.3
targets = "motor.R_a"
[[run]]
name = "one"
file = "one.npz"
purpose = "identification"
"""
    )
    np.savez(tmp_path / "one.npz", time=np.arange(100) * 0.01, command=np.zeros(100),
             current=np.zeros(100))  # fmt: skip
    with pytest.raises(ScenarioError, match=text):
        read_problem(tmp_path)
