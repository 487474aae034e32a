"""What takes next to nothing of what is evidently missing is not added, nor varied."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from cosim.diagnose.diagnosis import _slight
from cosim.diagnose.together import _better

COUNT = 1000


def fit(beyond: float, label: str = "delay") -> Any:
    """A fit that leaves so many nats beyond noise."""
    estimate = SimpleNamespace(robust=0.5 * COUNT + beyond, count=COUNT)
    return SimpleNamespace(estimate=estimate, effects=(SimpleNamespace(label=label),))


def search(unstable: bool = False) -> Any:
    return SimpleNamespace(
        raw=SimpleNamespace(unstable=unstable),
        gain=lambda first, second: first.estimate.robust - second.estimate.robust,
        gains=lambda first, second: (first.estimate.robust - second.estimate.robust, 0.0),
    )


@pytest.mark.parametrize(
    ("before", "after", "unstable", "slight"),
    [
        (5000.0, 4970.0, False, True),
        (5000.0, 4000.0, False, False),
        (90.0, 89.0, False, False),  # a noise that is off by a few per cent is no missing law
        (5000.0, 4970.0, True, False),  # moments that come too early are most of what is left
    ],
)
def test_a_further_law_must_take_a_tenth_of_what_is_evidently_missing(
    before: float, after: float, unstable: bool, slight: bool
) -> None:
    said: list[str] = []
    stage: Any = SimpleNamespace(base=fit(before), winner=fit(after))
    assert _slight(search(unstable), stage, said.append) is slight
    assert said == (["not added: delay, 0.6 % of what is left"] if slight else [])


def test_a_larger_set_must_take_a_tenth_of_what_smaller_ones_leave() -> None:
    declared, alone = fit(9000.0), SimpleNamespace(fitted=fit(1000.0))
    for left, better in ((950.0, False), (850.0, True), (1500.0, False)):
        one: Any = SimpleNamespace(fitted=fit(left))
        assert _better(search(), declared, one, [alone]) is better  # type: ignore[list-item]
    first: Any = SimpleNamespace(fitted=fit(8500.0))
    assert not _better(search(), declared, first, [])
