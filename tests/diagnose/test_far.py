"""Moments at which something turns over count little, but not where everything is far off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim.calibrate.loss import Huber, Windowed, loss_for, typical
from cosim.calibrate.problem import Problem
from cosim.diagnose.judge import OFF
from cosim.diagnose.rounds import Round
from cosim.diagnose.search import Search
from cosim.diagnose.values import Values
from tests.problems import simulator

pytestmark = pytest.mark.slow


def test_typical_windows_are_those_in_the_middle() -> None:
    rows = np.ones((100, 2))
    rows[:20] = 1e3
    rows[60:80, 1] = np.nan
    assert typical([rows]) == 1.0
    # the channel that is farthest off counts
    assert typical([rows, np.tile([4.0, 7.0], (300, 1))]) == 49.0


def test_few_windows_that_are_far_off_are_faults_of_the_data() -> None:
    few = np.ones((2000, 1))
    few[100:120] = 50.0
    many = few.copy()
    many[200:400] = 50.0
    assert loss_for(False, [("A", few)]) == Windowed()
    assert isinstance(loss_for(False, [("A", many)]), Huber)
    assert loss_for(True, [("A", many)]) == Windowed()


@pytest.mark.parametrize("offset", [0.0, 40.0])
def test_where_everything_is_far_off_residuals_count_in_full(
    clean_bench: Problem, offset: float
) -> None:
    # a parameter that counts as a start value of its runs
    unstable = clean_bench.changed(late=clean_bench.parameters[:1])
    data = {
        run.name: run.data + offset * unstable.sigma * np.sign(np.sin(60.0 * run.times))[:, None]
        for run in unstable.runs
    }
    search = Search(simulator(unstable.with_data(data)), only=[])
    fitted = search.calibrated()
    search.close()
    far = typical([search.fit_data[:, None] - fitted.fit[:, None]]) > OFF
    assert far == (offset > 0.0)
    for problem in (search.raw, search.declared, fitted.problem):
        assert problem.unstable != far
    assert search.fitting.unstable != far and search.checking.unstable != far
    # what the communication step adds at such parameters is not what it adds at the right ones
    measured = {run.name: run.data for run in search.raw.runs}
    as_measured = [
        np.array_equal(run.data, measured[run.name], True) for run in fitted.problem.runs
    ]
    assert as_measured == [far] * len(measured)
    assert fitted.problem.step == search.raw.search.step


@pytest.mark.parametrize("near", [True, False])
def test_moments_count_little_again_once_the_model_is_near(
    clean_bench: Problem, near: bool
) -> None:
    unstable = clean_bench.changed(late=clean_bench.parameters[:1])
    data = {
        run.name: run.data + 40.0 * unstable.sigma * np.sign(np.sin(60.0 * run.times))[:, None]
        for run in unstable.runs
    }
    search = Search(simulator(unstable.with_data(data)), only=[])
    base = search.calibrated()
    search.close()
    better = replace(base, values=Values(search.fit_data.copy(), search.check_data.copy()))
    winner = better if near else replace(base)
    stage = Round(base, [], {}, fitted=[winner], winner=winner)
    counted = search.recount(stage)
    assert (counted is base) is not near
    assert search.raw.unstable is near and search.fitting.unstable is near
    assert counted.problem.unstable is near
    assert stage.base is counted and stage.fitted == [stage.winner]
    assert stage.winner is not None and stage.winner.problem.unstable is near
    # what was far off costs less by its logarithm
    assert (counted.estimate.robust < 0.1 * base.estimate.robust) is near
