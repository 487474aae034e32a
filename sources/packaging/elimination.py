"""Sparse LU factorization of the implicit solver's matrix, unrolled at build time.

The matrix is `W = d I - J` with the pattern of the Jacobian J; W = L D U with units on the
diagonals of L and U, so that in both triangles a row waits for one product and one difference of
the row before. Elimination runs in the order of the states, without pivoting; fill-in is found
symbolically, so that the generated code touches nonzeros only. Not pivoting keeps every rounding
independent of states that are appended later (those of an effect of strength 0). A vanishing pivot
makes the step non-finite, which the FMU reports.

States of several effects fill the matrix between them, although an absent effect acts on nothing
outside: so its columns are looked at first, and where they are zero outside its own rows,
what only they fill is left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby


@dataclass(frozen=True)
class Block:
    """Statements that change nothing where one of the flags at these places in `w` is 0."""

    flags: tuple[int, ...]
    statements: tuple[str, ...]


@dataclass(frozen=True)
class Elimination:
    """Statements of the factorization and of the two triangular solves.

    Attributes:
        size: number of nonzeros of the factors, and of flags behind them.
        asked: the place in `w` of each flag, and the elements of `j` of which one must differ
            from zero.
        factor: statements over `w` (factors), `j` (Jacobian nonzeros) and `d`.
        solve: statements over `w` and the right-hand side `b`, which becomes the solution.
    """

    size: int
    asked: dict[int, tuple[int, ...]]
    factor: tuple[Block, ...]
    solve: tuple[Block, ...]


def eliminate(
    n: int, pattern: Sequence[tuple[int, int]], groups: Sequence[int] = ()
) -> Elimination:
    """Plan the elimination of an n x n matrix.

    Args:
        n: number of states.
        pattern: places of the Jacobian's nonzeros.
        groups: per state the effect that it belongs to, 0 for the model's own.
    """
    groups = list(groups) or [0] * n
    rows: list[set[int]] = [{i} for i in range(n)]
    for row, column in pattern:
        rows[row].add(column)
    for k in range(n):
        for i in range(k + 1, n):
            if k in rows[i]:
                rows[i] |= {j for j in rows[k] if j > k}
    index: dict[tuple[int, int], int] = {}
    for i in range(n):
        for j in sorted(rows[i]):
            index[i, j] = len(index)
    outside: dict[int, list[int]] = {group: [] for group in groups if group}
    for place, (i, j) in enumerate(pattern):
        if groups[j] and groups[i] != groups[j]:
            outside[groups[j]].append(place)
    flags = {group: len(index) + k for k, group in enumerate(outside)}

    def asked(*entries: tuple[int, int]) -> tuple[int, ...]:
        """Without these flags one of these entries is zero."""
        crossing = {groups[j] for i, j in entries if groups[j] and groups[i] != groups[j]}
        return tuple(sorted(flags[group] for group in crossing))

    source = {entry: k for k, entry in enumerate(pattern)}
    factor: list[tuple[tuple[int, ...], str]] = []
    for (i, j), k in index.items():
        value = f"-j[{source[i, j]}]" if (i, j) in source else "0.0"
        factor.append(((), f"w[{k}] = d + {value}" if i == j else f"w[{k}] = {value}"))
    for k in range(n):
        pivot = index[k, k]
        factor.append(((), f"w[{pivot}] = 1.0 / w[{pivot}]"))
        right = [j for j in sorted(rows[k]) if j > k]
        below = [i for i in range(k + 1, n) if k in rows[i]]
        factor += [
            (asked((k, j)), f"w[{index[k, j]}] = w[{index[k, j]}] * w[{pivot}]") for j in right
        ]
        inner = [
            (
                asked((i, k), (k, j)),
                f"w[{index[i, j]}] = w[{index[i, j]}] - w[{index[i, k]}] * w[{index[k, j]}]",
            )
            for i in below
            for j in right
        ]
        factor += sorted(inner, key=lambda one: one[0])  # in any order: no two concern one entry
        factor += [
            (asked((i, k)), f"w[{index[i, k]}] = w[{index[i, k]}] * w[{pivot}]") for i in below
        ]
    solve: list[tuple[tuple[int, ...], str]] = []
    for i in range(n):
        solve += [
            (asked((i, k)), f"b[{i}] = b[{i}] - w[{index[i, k]}] * b[{k}]")
            for k in sorted(rows[i])
            if k < i
        ]
    solve += [((), f"b[{i}] = b[{i}] * w[{index[i, i]}]") for i in range(n)]
    for i in reversed(range(n)):  # in each row last what is known last: nothing else waits for it
        solve += [
            (asked((i, j)), f"b[{i}] = b[{i}] - w[{index[i, j]}] * b[{j}]")
            for j in sorted(rows[i], reverse=True)
            if j > i
        ]
    return Elimination(
        len(index) + len(flags),
        {flags[group]: tuple(places) for group, places in outside.items()},
        _blocks(factor),
        _blocks(solve),
    )


def _blocks(statements: Iterable[tuple[tuple[int, ...], str]]) -> tuple[Block, ...]:
    """What stands one after the other under the same flags."""
    return tuple(
        Block(flags, tuple(statement for _, statement in some))
        for flags, some in groupby(statements, key=lambda one: one[0])
    )
