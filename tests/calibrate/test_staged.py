"""Runs that a model nearly explains lead the fit to where those that turn unstable come right."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cosim.calibrate import staged as stages
from cosim.calibrate.fit import DRAFT, fit
from cosim.calibrate.parts import MeasuredRun, Parameter
from cosim.calibrate.problem import Problem
from cosim.calibrate.simulator import Simulator
from cosim.calibrate.staged import jointly, staged
from cosim.errors import FmuCallError
from tests.problems import simulator

SIZE, ANGLE, LIMIT = 2.0, 0.03, 1.0


@pytest.fixture
def unstable(short: Problem, monkeypatch: pytest.MonkeyPatch) -> Problem:
    """A size that one run tells, and another in which a start angle decides what comes of it.

    A limit is told by the latter only, and steeply after its first half.
    """

    turn = {run.name: run.times[run.times.size // 2] for run in short.runs}

    def simulate(self: Simulator, theta: np.ndarray, run: MeasuredRun | str) -> np.ndarray:
        run = self.problem.run(run) if isinstance(run, str) else run
        found = self.problem.values(theta, run)
        size, angle = found["encoder.size"], found["encoder.angle"]
        limit = found["encoder.limit"]
        early = run.times < turn[run.name]
        if run.name == "sines":
            values = size * np.sin(2.0 * run.times)
        else:
            turned = 0.3 * np.sin(20.0 * size + 60.0 * angle + 10.0 * limit)
            values = np.where(early, 0.1 * size + angle + 0.1 * limit * run.times, turned)
        return np.tile(values, (len(self.problem.channels), 1)).T

    monkeypatch.setattr(Simulator, "simulate", simulate)
    monkeypatch.setattr(Problem, "_has", lambda *_: True)
    size = Parameter("size", "m", 1.0, 0.0, 4.0, (("encoder.size", 1.0),), span=1.0)
    limit = Parameter("limit", "m", LIMIT, 0.0, 4.0, (("encoder.limit", 1.0),), span=1.0)
    late = [
        Parameter(
            f"angle@{run.name}", "rad", 0.0, -1.0, 1.0, (("encoder.angle", 1.0),), "nuisance",
            run.name, 1.0, span=0.1,
        )
        for run in short.runs
    ]  # fmt: skip
    runs = [replace(r, starts={**r.starts, "encoder.angle": ANGLE}) for r in short.runs]
    channels = [replace(c, sigma=1e-3) for c in short.channels]
    problem = short.with_parameters([size, limit]).changed(runs=runs, channels=channels, late=late)
    truth = {
        run.name: simulator(problem).simulate(np.array([SIZE, LIMIT]), run) for run in problem.runs
    }
    random = np.random.default_rng(5)
    data = {name: v + 1e-3 * random.standard_normal(v.shape) for name, v in truth.items()}
    starts = [replace(r, starts={**r.starts, "encoder.angle": 0.0}) for r in problem.runs]
    return problem.changed(runs=starts).with_data(data)


def test_the_calmer_run_leads_to_the_right_minimum(unstable: Problem) -> None:
    begun = np.array([1.7, LIMIT])
    found, theta = staged(simulator(unstable), begun)
    problem = found.problem
    # the noise allows 1e-3 / sqrt(2000 samples of each channel): some 1e-5
    assert theta[0] == pytest.approx(SIZE, abs=1e-4)
    assert problem.names == unstable.names
    for name in ("stairs", "check"):
        assert problem.run(name).starts["encoder.angle"] == pytest.approx(ANGLE, abs=1e-4)
    last = fit(found, theta, effort=DRAFT)
    assert 2.0 * last.robust < 1.1 * last.count


def test_all_runs_at_once_end_elsewhere(unstable: Problem) -> None:
    found = fit(simulator(unstable), np.array([1.7, LIMIT]), effort=DRAFT)
    assert 2.0 * found.robust > 2.0 * found.count


def test_runs_are_fitted_up_to_where_the_model_leaves_them(
    unstable: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As long as that gets farther, and in whole where it does not leave them."""
    seen: list[dict[str, float]] = []

    def noted(simulator: Simulator, theta: np.ndarray, purpose: str) -> Any:
        runs = simulator.problem.chosen(purpose)
        seen.append({r.name: len(r.times) / len(unstable.run(r.name).times) for r in runs})
        return jointly(simulator, theta, purpose)

    monkeypatch.setattr(stages, "jointly", noted)
    theta = np.array([SIZE, LIMIT + 0.05])  # 5 sigma at its end
    _, theta = stages._advanced(simulator(unstable), theta, "identification")
    assert seen[0] == {"sines": 1.0, "stairs": pytest.approx(0.5, abs=0.03)}
    assert seen[-1] == {"sines": 1.0, "stairs": 1.0} and len(seen) < stages.ADVANCES
    assert theta == pytest.approx([SIZE, LIMIT], abs=1e-2)  # drafts


def test_what_was_reached_is_kept_where_derivatives_cannot_be_simulated(
    unstable: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: Any) -> Any:
        raise FmuCallError("it took too long")

    monkeypatch.setattr(stages, "jointly", refused)
    begun = np.array([SIZE, LIMIT + 0.05])
    found, theta = stages._advanced(simulator(unstable), begun, "identification")
    assert theta == pytest.approx(begun) and found.problem.names == unstable.names


def test_late_values_and_common_ones_are_fitted_together(unstable: Problem) -> None:
    close = {"encoder.angle": ANGLE + 2e-4}
    runs = [replace(r, starts={**r.starts, **close}) for r in unstable.runs]
    begun = np.array([SIZE + 1e-3, LIMIT + 1e-3])
    found, theta, known = jointly(simulator(unstable.changed(runs=runs)), begun)
    problem = found.problem
    # a draft: a hundredth of the span
    assert theta == pytest.approx([SIZE, LIMIT], abs=1e-2)
    assert problem.names == unstable.names and len(problem.late) == len(unstable.late)
    assert problem.run("stairs").starts["encoder.angle"] == pytest.approx(ANGLE, abs=1e-3)
    # no data of this run were used
    assert problem.run("check").starts == runs[-1].starts
    assert {"size", "limit", "angle@stairs"} <= set(known.place["stairs"])
