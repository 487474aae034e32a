"""Work is shared among helpers that wait for more of it, and whoever waits for them works too."""

from __future__ import annotations

import threading
from collections.abc import Callable

import pytest

from cosim.calibrate.threads import shared
from cosim.master.cores import VARIABLE, cores


@pytest.mark.parametrize("workers", [1, 2, 5])
def test_results_come_in_the_order_of_the_items(workers: int) -> None:
    assert shared(lambda item: item**2, range(20), workers) == [k**2 for k in range(20)]
    assert shared(lambda item: item, [], workers) == []


def test_two_items_are_in_work_at_once() -> None:
    meeting = threading.Barrier(2)  # of whom one alone would wait until it breaks
    shared(lambda item: meeting.wait(timeout=60.0), range(2), 2)


def test_who_is_helped_may_ask_for_help() -> None:
    def inner(item: int) -> int:
        return sum(shared(lambda part: item * part, range(4), 2))

    def outer(item: int) -> int:
        return sum(shared(inner, range(item, item + 4), 2))

    assert shared(outer, range(4), 2) == [6 * sum(range(k, k + 4)) for k in range(4)]


def test_helpers_stay_and_do_not_become_more() -> None:
    shared(str, range(8), 3)
    before = threading.active_count()
    for _ in range(20):
        shared(str, range(8), 3)
    assert threading.active_count() <= before + 1  # one that had not been needed yet


@pytest.mark.parametrize("workers", [1, 3])
def test_of_several_errors_the_first_counts_and_nothing_is_begun_after_it(workers: int) -> None:
    begun = []

    def failing(item: int) -> None:
        begun.append(item)
        if item >= 2:
            raise ValueError(f"item {item}")

    with pytest.raises(ValueError, match="item 2"):
        shared(failing, range(50), workers)
    assert len(begun) <= 2 + workers


@pytest.mark.parametrize(("told", "found"), [("3", 3), ("1", 1)])
def test_the_environment_says_how_many_processors_there_are(
    told: str, found: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, told)
    assert cores() == found


@pytest.mark.parametrize("told", ["", "0", "many", "default"])
def test_else_it_is_those_that_the_process_may_use(
    told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, told)
    monkeypatch.setattr("os.sched_getaffinity", lambda process: {2, 5, 7}, raising=False)
    assert cores() == 3
    monkeypatch.delattr("os.sched_getaffinity")
    count: Callable[[], None] = lambda: None  # noqa: E731
    monkeypatch.setattr("os.cpu_count", count)
    assert cores() == 1
