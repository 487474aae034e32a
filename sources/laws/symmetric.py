"""Small symmetric positive definite systems, solved without pivoting."""

from __future__ import annotations

from typing import Any

import casadi as ca

SX = Any


def solve(matrix: SX, right: SX) -> SX:
    """Solution x of `matrix x = right`, by matrix = L D L^T; only the lower triangle is read."""
    size = right.numel()
    lower: list[list[SX]] = [[] for _ in range(size)]
    scaled: list[list[SX]] = [[] for _ in range(size)]  # L D
    inverse: list[SX] = []  # of D
    forward: list[SX] = []
    for i in range(size):
        for k in range(i):
            scaled[i].append(matrix[i, k] - _dot(scaled[i], lower[k]))
            lower[i].append(scaled[i][k] * inverse[k])
        inverse.append(1 / (matrix[i, i] - _dot(scaled[i], lower[i])))
        forward.append(right[i] - _dot(lower[i], forward))
    x = [f * d for f, d in zip(forward, inverse, strict=True)]
    for i in reversed(range(size)):
        x[i] -= sum((lower[k][i] * x[k] for k in range(i + 1, size)), ca.SX(0))
    return ca.vertcat(*x)


def unpack(upper: SX, size: int) -> SX:
    """The symmetric matrix whose upper triangle is given row by row."""
    full = ca.SX.zeros(size, size)
    index = 0
    for i in range(size):
        for j in range(i, size):
            full[i, j] = full[j, i] = upper[index]
            index += 1
    return full


def _dot(first: list[SX], second: list[SX]) -> SX:
    return sum((a * b for a, b in zip(first, second, strict=False)), ca.SX(0))
