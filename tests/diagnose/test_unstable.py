"""Runs end where a model leaves them because of what nobody can know, and nowhere else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cosim.calibrate.fit import POLISH, fit
from cosim.calibrate.loss import WINDOW
from cosim.calibrate.parts import MeasuredRun, Parameter
from cosim.calibrate.problem import Problem
from cosim.calibrate.simulator import Simulator
from cosim.diagnose import Diagnosis
from cosim.diagnose.answer import Verdict
from cosim.diagnose.course import shortened
from cosim.diagnose.left_over import left_over
from cosim.diagnose.models import Fitted
from cosim.diagnose.rounds import Round
from cosim.diagnose.search import Search
from cosim.diagnose.unstable import ended, ends
from cosim.errors import FmuCallError
from cosim.report import sections
from tests.problems import simulator

pytestmark = pytest.mark.slow

SIGMA, SIZE, ANGLE = 1e-3, 2.0, 0.01
STEEP = 300.0


@pytest.fixture
def turning(clean_bench: Problem, monkeypatch: pytest.MonkeyPatch) -> Problem:
    """In one run an angle that hardly matters decides in the middle what comes of it."""
    turn, first = {}, clean_bench.chosen("identification")[0].name
    for run in clean_bench.runs:
        turn[run.name] = run.times[run.times.size // 2]

    def simulate(self: Simulator, theta: np.ndarray, run: MeasuredRun | str) -> np.ndarray:
        run = self.problem.run(run) if isinstance(run, str) else run
        found = self.problem.values(theta, run)
        values = found["encoder.size"] * np.sin(2.0 * run.times)
        if run.name == first:
            turned = 0.3 * np.sin(STEEP * found["encoder.angle"])
            values = values + np.where(run.times < turn[run.name], 0.0, turned)
        return np.tile(values, (len(self.problem.channels), 1)).T

    monkeypatch.setattr(Simulator, "simulate", simulate)
    monkeypatch.setattr(Problem, "_has", lambda *_: True)
    size = Parameter("size", "m", SIZE, 0.0, 4.0, (("encoder.size", 1.0),), span=1.0)
    late = [
        Parameter(
            f"angle@{run.name}", "rad", ANGLE, -1.0, 1.0, (("encoder.angle", 1.0),), "nuisance",
            run.name, 0.01, span=0.1,
        )
        for run in clean_bench.runs
    ]  # fmt: skip
    runs = [replace(r, starts={**r.starts, "encoder.angle": ANGLE}) for r in clean_bench.runs]
    channels = [replace(c, sigma=SIGMA) for c in clean_bench.channels]
    problem = clean_bench.with_parameters([size]).changed(runs=runs, channels=channels, late=late)
    random = np.random.default_rng(5)
    theta = problem.nominal
    data = {
        run.name: (v := simulator(problem).simulate(theta, run))
        + SIGMA * random.standard_normal(v.shape)
        for run in problem.runs
    }
    return problem.with_data(data)


def elsewhere(problem: Problem, angle: float) -> Problem:
    """The problem with another start angle."""
    return problem.changed(
        runs=[replace(r, starts={**r.starts, "encoder.angle": angle}) for r in problem.runs]
    )


def test_a_run_ends_where_an_instability_takes_the_model_off(turning: Problem) -> None:
    names = [run.name for run in turning.runs]
    first = turning.chosen("identification")[0]
    wrong = elsewhere(turning, ANGLE + 0.003)
    found = ends(simulator(wrong), turning.nominal, names)
    middle = first.times.size // 2
    assert set(found) == {first.name}
    assert middle - WINDOW < found[first.name] <= middle
    short = ended(wrong, found)
    assert short.run(first.name).data.shape[0] == found[first.name]
    assert all(short.run(n).data.shape == turning.run(n).data.shape for n in names[1:])


def test_a_model_that_leaves_no_run_or_lacks_something_else_loses_none(turning: Problem) -> None:
    names = [run.name for run in turning.runs]
    assert ends(simulator(turning), turning.nominal, names) == {}
    far = np.array([SIZE * 1.2])  # far off in all runs, from the beginning
    found = ends(simulator(turning), far, names)
    first = turning.chosen("identification")[0]
    # runs that are not sensitive count in full; the sensitive one counts until it is
    assert set(found) == {first.name} and found[first.name] >= first.times.size // 2 - WINDOW


Found = tuple[Diagnosis, Search, Fitted, Round]


@pytest.fixture
def found_in(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Found]:
    """A diagnosis whose only round found a model; nothing is exchanged in steps."""

    def exact(simulator: Simulator, *_: Any) -> dict[str, float]:
        return {run.name: 0.0 for run in simulator.problem.runs}

    for module in ("values", "left_over"):
        monkeypatch.setattr(f"cosim.diagnose.{module}.step_error", exact)

    def found(problem: Problem, say: Callable[[str], None] = lambda text: None) -> Found:
        search = Search(simulator(problem), say, only=[])
        model = search.judged(fit(simulator(problem), problem.nominal, effort=POLISH))
        result = Diagnosis(problem, Verdict(""), search=search, before=model)
        return result, search, model, Round(model, [], {}, winner=model)

    return found


@pytest.mark.parametrize(("angle", "gone"), [(ANGLE + 0.003, True), (ANGLE, False)])
def test_further_effects_are_looked_for_before_that(
    turning: Problem, found_in: Callable[..., Found], angle: float, gone: bool
) -> None:
    problem = elsewhere(turning, angle)
    first = problem.chosen("identification")[0]
    result, search, model, stage = found_in(problem)
    assert search.lacking(model) == gone
    found = shortened(result, [stage], model)
    assert not search.lacking(found)
    assert (found is not model) == (search.fit_data.size < model.fit.size) == gone
    middle = float(first.times[first.times.size // 2])
    assert result.ended == ({first.name: pytest.approx(middle, abs=0.02)} if gone else {})
    result.after = found
    left_over(result)
    # tables have the runs in full
    assert result.residuals["after", first.name].shape == first.data.shape
    assert (">1.00 s</td>" in sections.ended(result.ended)) == gone


def test_where_a_changed_value_cannot_be_simulated_runs_count_in_full(
    turning: Problem, found_in: Callable[..., Found], monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []
    result, _, model, stage = found_in(elsewhere(turning, ANGLE + 0.003), said.append)

    def fails(*_: Any) -> dict[str, int]:
        raise FmuCallError("it runs away")

    monkeypatch.setattr("cosim.diagnose.course.ends", fails)
    assert shortened(result, [stage], model) is model
    assert said[-1] == "where runs turn unstable is not known: it runs away"
