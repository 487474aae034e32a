"""The best fit of each set of effects is kept, and runs that end earlier do so in all of them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosim.calibrate.estimate import Estimate
from cosim.diagnose.linear import SampleStack
from cosim.diagnose.memo import Memo
from cosim.diagnose.models import Fitted
from cosim.diagnose.values import Values


def fitted(value: float, *labels: str, size: int = 4) -> Fitted:
    """A model whose values are all the same."""
    one: Any = np.zeros(0)
    estimate = Estimate(
        one, one, one, one, one, one, (), (), value, value, size, 1, jacobian=[one], residuals=[]
    )
    effects: Any = tuple(SimpleNamespace(label=label) for label in labels)
    return Fitted(effects, estimate, Values(np.full(size, value), np.full(size, value)))


@pytest.mark.parametrize(("later", "kept"), [(0.9, 0.9), (1.1, 1.1), (1.3, 1.0)])
def test_a_later_fit_is_kept_unless_it_is_evidently_worse(later: float, kept: float) -> None:
    """One that is worse by 0.2 nats is as near to the minimum, and has the better intervals."""

    def worse(first: Fitted, second: Fitted) -> float:
        return float(second.fit[0] - first.fit[0])

    memo = Memo()
    for value in (1.0, later):
        memo.note(fitted(value, "a", "b"), worse)
    memo.note(fitted(7.0, "a"), worse)
    found = memo.get(frozenset("ba"))
    assert found is not None and found.fit[0] == kept and found.estimate.jacobian == []
    assert [sorted(f.labels) for f in memo] == [["a", "b"], ["a"]]
    memo.keep(fitted(9.0, "a", "b"))
    assert memo.get(frozenset("ab")).fit[0] == 9.0  # type: ignore[union-attr]


def test_runs_end_earlier_in_all_fits() -> None:
    problem: Any = SimpleNamespace(channels=[0], unstable=False)

    def stack(*sizes: int) -> SampleStack:
        runs: Any = [
            SimpleNamespace(name=str(n), times=np.arange(n) / 10, data=np.zeros((n, 1)))
            for n in sizes
        ]
        return SampleStack(problem, runs)

    memo = Memo()
    one = fitted(1.0, "a", size=50)
    one.fit[:] = np.arange(50)
    memo.keep(one)
    memo.cut((stack(30, 20), stack(50)), (stack(10, 20), stack(40)))
    found = memo.get(frozenset("a"))
    assert found is not None
    assert found.fit.tolist() == [*range(10), *range(30, 50)] and found.check.size == 40
