"""Runs that a model nearly explains lead the fit to where those that turn unstable come right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim.calibrate.fit import fit
from cosim.calibrate.parts import Parameter, Run
from cosim.calibrate.problem import Problem
from cosim.calibrate.staged import staged

SIZE, ANGLE = 2.0, 0.03


@pytest.fixture
def unstable(short: Problem, monkeypatch: pytest.MonkeyPatch) -> Problem:
    """A size that one run tells, and another in which a start angle decides what comes of it."""

    def simulate(self: Problem, theta: np.ndarray, run: Run | str) -> np.ndarray:
        run = self.run(run) if isinstance(run, str) else run
        found = self.values(theta, run)
        size, angle = found["encoder.size"], found["encoder.angle"]
        early = run.times < run.times[run.times.size // 2]
        if run.name == "sines":
            values = size * np.sin(2.0 * run.times)
        else:
            values = np.where(early, 0.1 * size + angle, 3.0 * np.sin(20.0 * size + 60.0 * angle))
        return np.tile(values, (len(self.channels), 1)).T

    monkeypatch.setattr(Problem, "simulate", simulate)
    monkeypatch.setattr(Problem, "_has", lambda *_: True)
    size = Parameter("size", "m", 1.0, 0.0, 4.0, (("encoder.size", 1.0),), span=1.0)
    late = [
        Parameter(
            f"angle@{run.name}", "rad", 0.0, -1.0, 1.0, (("encoder.angle", 1.0),), "nuisance",
            run.name, 1.0, span=0.1,
        )
        for run in short.runs
    ]  # fmt: skip
    runs = [replace(r, starts={**r.starts, "encoder.angle": ANGLE}) for r in short.runs]
    channels = [replace(c, sigma=1e-3) for c in short.channels]
    problem = short.with_parameters([size])._with(runs=runs, channels=channels, late=late)
    truth = {run.name: problem.simulate(np.array([SIZE]), run) for run in problem.runs}
    random = np.random.default_rng(5)
    data = {name: v + 1e-3 * random.standard_normal(v.shape) for name, v in truth.items()}
    starts = [replace(r, starts={**r.starts, "encoder.angle": 0.0}) for r in problem.runs]
    return problem._with(runs=starts).with_data(data)


def test_the_calmer_run_leads_to_the_right_minimum(unstable: Problem) -> None:
    begun = np.array([1.7])
    problem, theta = staged(unstable, begun)
    # the noise allows 1e-3 / sqrt(2000 samples of each channel): some 1e-5
    assert theta[0] == pytest.approx(SIZE, abs=1e-4)
    assert problem.names == unstable.names
    for name in ("stairs", "check"):
        assert problem.run(name).starts["encoder.angle"] == pytest.approx(ANGLE, abs=1e-4)
    found = fit(problem, theta, near=True, draft=True)
    assert 2.0 * found.robust < 1.1 * found.count


def test_all_runs_at_once_end_elsewhere(unstable: Problem) -> None:
    found = fit(unstable, np.array([1.7]), near=True, draft=True)
    assert 2.0 * found.robust > 2.0 * found.count
