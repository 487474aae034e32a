"""Values of single runs are fitted to these runs alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim.calibrate.loss import Windowed
from cosim.calibrate.nuisance import HORIZONS, released, settled, slopes
from cosim.calibrate.parts import MeasuredRun, Parameter
from cosim.calibrate.problem import Problem
from cosim.calibrate.simulator import Simulator
from cosim.errors import FmuCallError
from tests.problems import simulator

SHIFT = 0.02


def shifted(short: Problem, truth: np.ndarray, prior: float | None) -> tuple[Problem, np.ndarray]:
    """The validation run's angle begins elsewhere than its nominal value says."""
    own = Parameter(
        "theta_0@check", "rad", 0.0, -1.0, 1.0, (("encoder.theta", 1.0),), "nuisance", "check",
        prior, span=0.1,
    )  # fmt: skip
    problem = short.with_parameters([*short.parameters, own])
    run = problem.run("check")
    data = simulator(problem).simulate(np.append(truth, SHIFT), run)
    runs = [replace(r, data=data) if r.name == "check" else r for r in problem.runs]
    return problem.changed(runs=runs), np.append(truth, 0.0)


def test_the_start_value_is_recovered_and_nothing_else_moves(
    short: Problem, truth: np.ndarray
) -> None:
    problem, theta = shifted(short, truth, None)
    found = settled(simulator(problem), theta, ["check"])
    # data are exact, the model linear in its start angle: what is left is the difference's rounding
    assert found[-1] == pytest.approx(SHIFT, rel=1e-6)
    assert np.array_equal(found[:-1], theta[:-1])


def test_a_prior_holds_it_back(short: Problem, truth: np.ndarray) -> None:
    problem, theta = shifted(short, truth, 1e-9)
    assert abs(settled(simulator(problem), theta, ["check"])[-1]) < 0.01 * SHIFT


def test_runs_without_such_values_are_left_alone(short: Problem, truth: np.ndarray) -> None:
    problem, theta = shifted(short, truth, None)
    assert np.array_equal(settled(simulator(problem), theta, ["sines"]), theta)


def test_late_values_are_held_at_what_each_run_says(short: Problem, truth: np.ndarray) -> None:
    problem, theta = shifted(short, truth, 0.1)
    own = problem.parameters[-1]
    runs = [replace(r, starts={**r.starts, "encoder.theta": 0.0}) for r in problem.runs]
    waiting = problem.with_parameters(problem.parameters[:-1]).changed(late=[own], runs=runs)
    result, values, fall = released(simulator(waiting), theta[:-1])
    assert np.array_equal(values, theta[:-1]) and result.problem.names == waiting.names
    # relative: the prior of five times the shift pulls a little
    assert result.problem.run("check").starts["encoder.theta"] == pytest.approx(SHIFT, rel=1e-3)
    assert result.problem.run("sines").starts == waiting.run("sines").starts
    before, after = (
        sum(Windowed().cost(r) for _, r in simulator(p).residuals(values, ["check"]))
        for p in (waiting, result.problem)
    )
    assert after < 1e-6 * before
    assert fall == pytest.approx(before, rel=1e-3)  # the prior's own 0.02 nats
    again, _, more = released(result, values)
    assert again.problem.run("check").starts["encoder.theta"] == pytest.approx(SHIFT, rel=1e-3)
    assert abs(more) < 1e-3 * fall


def test_a_run_that_cannot_be_simulated_elsewhere_keeps_its_value(
    short: Problem, truth: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And the others are estimated all the same."""
    problem, theta = shifted(short, truth, 0.1)
    own = problem.parameters[-1]
    other = replace(own, name="theta_0@sines", run="sines")
    runs = [replace(r, starts={**r.starts, "encoder.theta": 0.0}) for r in problem.runs]
    waiting = problem.with_parameters(problem.parameters[:-1]).changed(late=[own, other], runs=runs)
    simulate = Simulator.simulate

    def strict(self: Simulator, theta: np.ndarray, run: MeasuredRun | str) -> np.ndarray:
        run = self.problem.run(run) if isinstance(run, str) else run
        if run.name == "sines" and self.problem.values(theta, run).get("encoder.theta"):
            raise FmuCallError("it took too long")
        return simulate(self, theta, run)

    monkeypatch.setattr(Simulator, "simulate", strict)
    result, _, fall = released(simulator(waiting), theta[:-1])
    # as above
    assert result.problem.run("check").starts["encoder.theta"] == pytest.approx(SHIFT, rel=1e-3)
    assert result.problem.run("sines").starts["encoder.theta"] == 0.0
    assert fall > 0.0


def test_a_step_that_makes_a_run_worse_is_shortened(short: Problem, truth: np.ndarray) -> None:
    """Derivatives that are ten times too small ask for ten times the step."""
    problem, theta = shifted(short, truth, None)
    known = slopes(simulator(problem), theta, ["check"])
    wrong = {n: item._replace(values=0.1 * item.values) for n, item in known.items()}
    run = problem.run("check")

    def square(values: np.ndarray) -> float:
        return float(np.nansum((run.data - simulator(problem).simulate(values, run)) ** 2))

    found = settled(simulator(problem), theta, ["check"], wrong)
    assert square(found) < 0.1 * square(theta)  # a tenth of a full step is shorter than 0.3^2


@pytest.mark.parametrize("horizons, found", [(HORIZONS, True), ((1.0,), False)])
def test_beginnings_lead_to_the_right_minimum(
    short: Problem, monkeypatch: pytest.MonkeyPatch, horizons: tuple[float, ...], found: bool
) -> None:
    """A model that tells the angle at first, and later a wave of it with minima everywhere."""
    turn = {run.name: run.times[run.times.size // 2] for run in short.runs}

    def simulate(self: Simulator, theta: np.ndarray, run: MeasuredRun | str) -> np.ndarray:
        run = self.problem.run(run) if isinstance(run, str) else run
        angle = self.problem.values(theta, run)["encoder.theta"]
        late = run.times > turn[run.name]
        return np.tile(
            np.where(late, 100.0 * np.sin(60.0 * angle), angle), (len(self.problem.channels), 1)
        ).T

    monkeypatch.setattr(Simulator, "simulate", simulate)
    monkeypatch.setattr("cosim.calibrate.nuisance.HORIZONS", horizons)
    problem, theta = shifted(short, short.nominal, 1.0)
    runs = [
        replace(r, starts={**r.starts, "encoder.theta": 10.0 * SHIFT}) for r in problem.runs
    ]  # two periods of the wave away
    own = replace(problem.parameters[-1], nominal=10.0 * SHIFT)
    waiting = problem.with_parameters(problem.parameters[:-1]).changed(late=[own], runs=runs)
    result, _, _ = released(simulator(waiting), theta[:-1])
    angle = result.problem.run("check").starts["encoder.theta"]
    assert (angle == pytest.approx(SHIFT, rel=1e-3)) is found


def test_values_that_were_estimated_before_are_kept_or_begun_anew(
    short: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A wave of the angle: what was found before holds it in the wrong minimum."""

    def simulate(self: Simulator, theta: np.ndarray, run: MeasuredRun | str) -> np.ndarray:
        run = self.problem.run(run) if isinstance(run, str) else run
        angle = self.problem.values(theta, run)["encoder.theta"]
        early = run.times < run.times[run.times.size // 2]
        values = np.where(early, 30.0 * angle, 100.0 * np.sin(60.0 * angle))
        return np.tile(values, (len(self.problem.channels), 1)).T

    monkeypatch.setattr(Simulator, "simulate", simulate)
    problem, theta = shifted(short, short.nominal, 1.0)
    own = problem.parameters[-1]
    for start in (SHIFT + 0.001, SHIFT + 2 * np.pi / 60.0):
        runs = [replace(r, starts={**r.starts, "encoder.theta": start}) for r in problem.runs]
        waiting = problem.with_parameters(problem.parameters[:-1]).changed(late=[own], runs=runs)
        result, _, fall = released(simulator(waiting), theta[:-1])
        assert result.problem.run("check").starts["encoder.theta"] == pytest.approx(SHIFT, rel=1e-3)
        assert fall > 0.0
