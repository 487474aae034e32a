"""Sparse LU factorization of the implicit solver's matrix, unrolled at build time.

The matrix is `W = d I - J` with the pattern of the Jacobian J; W = L D U with units on the
diagonals of L and U, so that in both triangles a row waits for one product and one difference of
the row before. Elimination runs in the order of the states, without pivoting; fill-in is found
symbolically, so that the generated code touches nonzeros only. Not pivoting keeps every rounding
independent of states that are appended later (those of an effect of strength 0). A vanishing pivot
makes the step non-finite, which the FMU reports.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Elimination:
    """Statements of the factorization and of the two triangular solves.

    Attributes:
        size: number of nonzeros of the factors.
        factor: statements over `w` (factors), `j` (Jacobian nonzeros) and `d`.
        solve: statements over `w` and the right-hand side `b`, which becomes the solution.
    """

    size: int
    factor: tuple[str, ...]
    solve: tuple[str, ...]


def eliminate(n: int, pattern: Sequence[tuple[int, int]]) -> Elimination:
    """Plan the elimination of an n x n matrix whose Jacobian nonzeros are at `pattern`."""
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
    source = {entry: k for k, entry in enumerate(pattern)}
    factor: list[str] = []
    for (i, j), k in index.items():
        value = f"-j[{source[i, j]}]" if (i, j) in source else "0.0"
        factor.append(f"w[{k}] = d + {value}" if i == j else f"w[{k}] = {value}")
    for k in range(n):
        pivot = index[k, k]
        factor.append(f"w[{pivot}] = 1.0 / w[{pivot}]")
        right = [j for j in sorted(rows[k]) if j > k]
        below = [i for i in range(k + 1, n) if k in rows[i]]
        factor.extend(f"w[{index[k, j]}] = w[{index[k, j]}] * w[{pivot}]" for j in right)
        for i in below:
            factor.extend(
                f"w[{index[i, j]}] = w[{index[i, j]}] - w[{index[i, k]}] * w[{index[k, j]}]"
                for j in right
            )
            factor.append(f"w[{index[i, k]}] = w[{index[i, k]}] * w[{pivot}]")
    solve: list[str] = []
    for i in range(n):
        solve.extend(
            f"b[{i}] = b[{i}] - w[{index[i, k]}] * b[{k}]" for k in sorted(rows[i]) if k < i
        )
    solve.extend(f"b[{i}] = b[{i}] * w[{index[i, i]}]" for i in range(n))
    for i in reversed(range(n)):  # in each row last what is known last: nothing else waits for it
        solve.extend(
            f"b[{i}] = b[{i}] - w[{index[i, j]}] * b[{j}]"
            for j in sorted(rows[i], reverse=True)
            if j > i
        )
    return Elimination(len(index), tuple(factor), tuple(solve))
