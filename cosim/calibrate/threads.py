"""Work that is shared among threads, which wait for more of it instead of being made anew."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


@lru_cache
def _helpers(count: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(count, "cosim")


def shared(function: Callable[[Item], Result], items: Sequence[Item], workers: int) -> list[Result]:
    """Apply a function to items, in this thread and in helpers; results in the items' order.

    The caller works as well, so whoever is called in a helper may share its own work again: if all
    helpers are busy, it does everything itself. Of several errors the one of the first item counts.

    Args:
        function: called once per item.
        items: handed out in order, none after an error.
        workers: threads, the caller's included.
    """
    found: dict[int, Result] = {}
    errors: dict[int, BaseException] = {}
    numbers = iter(range(len(items)))

    def work() -> None:
        for number in numbers:
            if errors:
                return
            try:
                found[number] = function(items[number])
            except BaseException as error:  # raised below, by the caller
                errors[number] = error

    wanted = min(workers, len(items)) - 1
    helpers = [_helpers(workers - 1).submit(work) for _ in range(wanted)]
    work()
    for helper in helpers:
        if not helper.cancel():
            helper.result()
    if errors:
        raise errors[min(errors)]
    return [found[number] for number in range(len(items))]
