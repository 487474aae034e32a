"""A burst is named and pulls no parameter; without one nothing is named."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosim.calibrate.problem import Problem
from cosim.diagnose.bursts import bursts, times
from cosim.diagnose.linear import SampleStack
from cosim.diagnose.search import Search
from cosim.report import sections
from tests.problems import simulator

FIRST, LAST = 500, 540


def test_windows_with_a_burst_and_their_neighbours_are_found() -> None:
    run: Any = SimpleNamespace(name="A", times=np.arange(200) / 100, data=np.zeros((200, 2)))
    layout = SampleStack(SimpleNamespace(channels=[0, 1], unstable=False), [run])  # type: ignore[arg-type]
    residual = np.random.default_rng(0).standard_normal((200, 2))
    assert bursts(residual.ravel(), layout) == {}
    residual[105:115, 1] = 20.0
    where = np.flatnonzero(bursts(residual.ravel(), layout)["A"])
    assert (where[0], where[-1], where.size) == (80, 139, 60)
    run.logged = run.times - 0.5  # the model begins before the log, which is what people look at
    ((begin, end),) = times({"A": np.isin(np.arange(200), where)}, [run])["A"]
    assert (begin, end) == pytest.approx((0.3, 0.89))


@pytest.mark.slow
def test_a_burst_pulls_no_parameter(clean_bench: Problem) -> None:
    run = clean_bench.chosen("identification")[0]
    data = run.data.copy()
    data[FIRST:LAST, 2] += 80.0 * clean_bench.sigma[2]
    values = []
    for problem in (clean_bench, clean_bench.with_data({run.name: data})):
        search = Search(simulator(problem), only=[])
        fitted = search.calibrated()
        values.append(fitted.estimate)
        found = bursts(search.fit_data - fitted.fit, search.fitting)
        spans = times(found, list(search.fitting.runs))
        if problem is clean_bench:
            assert spans == {}
        else:
            assert list(spans) == [run.name]
            ((begin, end),) = spans[run.name]
            assert begin <= run.times[FIRST] and end >= run.times[LAST]
            assert end - begin < 0.05 * (run.times[-1] - run.times[0])
            assert f"{begin:.2f} to {end:.2f} s" in sections.bursts(spans)
        search.close()
    assert sections.bursts({}) == ""
    one, other = values
    known = one.identifiable & other.identifiable
    width = one.high - one.low
    off = 2.0 * np.abs(other.theta - one.theta)[known] / width[known]
    # half-widths of the intervals, 0.17 was seen; as squares, 40 samples of 80 sigma pull by more
    # than one
    assert np.max(off) < 0.25
    # squares of 80 sigma would widen the intervals several times; 1.3 is what was seen
    assert np.max((other.high - other.low)[known] / width[known]) < 1.5
