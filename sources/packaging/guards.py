"""What need not be computed while an effect is absent.

Most effects of an FMU are absent most of the time, and their laws may take ten times as long as
the model: a patch on the floor asks for a `tanh` at each road wheel. What is multiplied by a
strength is zero where that is zero, and so is what a condition on parameters leaves out. All that
only such products read is left out with them: the C code asks first. Nothing else changes by a bit,
but for the sign of zeros; and what an absent effect cannot compute disturbs nobody.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import casadi as ca

MOST = 8
"""A value that more effects than these have in common is always computed: one of them will be
there."""

Guard = frozenset[int] | None
"""The values of which one must differ from zero; None: computed always."""

_ZERO_IF_ONE = (ca.OP_MUL,)
_ZERO_IF_ALL = (ca.OP_ADD, ca.OP_SUB, ca.OP_FMIN, ca.OP_FMAX)
_ZERO_IF_FIRST = (ca.OP_DIV, ca.OP_ASSIGN, ca.OP_NEG, ca.OP_TWICE, ca.OP_SQ, ca.OP_FABS)


def zeros(operation: int, of: Sequence[frozenset[int]], condition: int | None) -> frozenset[int]:
    """The values that make a result zero where one of them is zero.

    Args:
        operation: CasADi's.
        of: the same of its arguments.
        condition: the number of a condition on parameters only, of `OP_IF_ELSE_ZERO`.
    """
    if operation in _ZERO_IF_ONE:
        return of[0] | of[1]
    if operation in _ZERO_IF_ALL:
        return of[0] & of[1]
    if operation in _ZERO_IF_FIRST:
        return of[0]
    if operation == ca.OP_IF_ELSE_ZERO:
        return of[0] | of[1] | (frozenset() if condition is None else {condition})
    return frozenset()


@dataclass(frozen=True)
class Chunk:
    """Values that are computed one after the other under one guard."""

    guard: Guard
    numbers: tuple[int, ...]


def guards(
    order: Sequence[int],
    results: Collection[int],
    of: Callable[[int], Sequence[int]],
    zero: Callable[[int], frozenset[int]],
) -> dict[int, Guard]:
    """The guard of each value that a result hangs on.

    Args:
        order: numbers of the values, each behind its arguments.
        results: numbers that are asked for.
        of: numbers of a value's arguments that are computed too.
        zero: what makes a value zero, see `zeros`.
    """
    found: dict[int, Guard] = {}
    asked: dict[int, Guard] = dict.fromkeys(results)
    for number in reversed(order):
        if number not in asked:
            continue
        own = zero(number)
        guard = frozenset([min(own)]) if own else asked[number]
        found[number] = guard
        for argument in of(number):
            before = asked.get(argument, frozenset())
            both = None if guard is None or before is None else guard | before
            asked[argument] = None if both is None or len(both) > MOST else both
    return found


def chunks(
    order: Sequence[int], guard: Callable[[int], Guard], of: Callable[[int], Sequence[int]]
) -> list[Chunk]:
    """The values in an order in which those of one guard stand together as far as can be.

    Args:
        order: numbers of the values, each behind its arguments.
        guard: of a value.
        of: numbers of a value's arguments that are in `order`.
    """
    found: list[Chunk] = []
    waiting, done = list(order), set[int]()
    while waiting:
        ready = [n for n in waiting if done.issuperset(of(n))]
        always = any(guard(n) is None for n in ready)
        here = None if always else guard(ready[0])
        taken, left = [], []
        for number in waiting:
            if guard(number) == here and done.issuperset(of(number)):
                taken.append(number)
                done.add(number)
            else:
                left.append(number)
        found.append(Chunk(here, tuple(taken)))
        waiting = left
    return found
