"""Values of single runs are fitted to these runs alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim.calibrate.nuisance import settled
from cosim.calibrate.parts import Parameter
from cosim.calibrate.problem import Problem

SHIFT = 0.02


def shifted(short: Problem, truth: np.ndarray, prior: float | None) -> tuple[Problem, np.ndarray]:
    """The validation run's angle begins elsewhere than its nominal value says."""
    own = Parameter(
        "theta_0@check", "rad", 0.0, -1.0, 1.0, (("encoder.theta", 1.0),), "nuisance", "check",
        prior, span=0.1,
    )  # fmt: skip
    problem = short.with_parameters([*short.parameters, own])
    run = problem.run("check")
    data = problem.simulate(np.append(truth, SHIFT), run)
    runs = [replace(r, data=data) if r.name == "check" else r for r in problem.runs]
    return problem._with(runs=runs), np.append(truth, 0.0)


def test_the_start_value_is_recovered_and_nothing_else_moves(
    short: Problem, truth: np.ndarray
) -> None:
    problem, theta = shifted(short, truth, None)
    found = settled(problem, theta, ["check"])
    # data are exact, the model linear in its start angle: what is left is the difference's rounding
    assert found[-1] == pytest.approx(SHIFT, rel=1e-6)
    assert np.array_equal(found[:-1], theta[:-1])


def test_a_prior_holds_it_back(short: Problem, truth: np.ndarray) -> None:
    problem, theta = shifted(short, truth, 1e-9)
    assert abs(settled(problem, theta, ["check"])[-1]) < 0.01 * SHIFT


def test_runs_without_such_values_are_left_alone(short: Problem, truth: np.ndarray) -> None:
    problem, theta = shifted(short, truth, None)
    assert np.array_equal(settled(problem, theta, ["sines"]), theta)
