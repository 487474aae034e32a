"""Small symmetric positive definite systems, solved without pivoting."""

from __future__ import annotations

from typing import Any

import casadi as ca

SX = Any


def solve(matrix: SX, right: SX) -> SX:
    """Solution x of `matrix x = right`, by matrix = L D L^T; only the lower triangle is read."""
    size = right.numel()
    L: list[list[SX]] = [[] for _ in range(size)]
    LD: list[list[SX]] = [[] for _ in range(size)]
    inverse: list[SX] = []  # of D
    forward: list[SX] = []
    for i in range(size):
        for k in range(i):
            LD[i].append(matrix[i, k] - _dot(LD[i], L[k]))
            L[i].append(LD[i][k] * inverse[k])
        inverse.append(1 / (matrix[i, i] - _dot(LD[i], L[i])))
        forward.append(right[i] - _dot(L[i], forward))
    x = [f * d for f, d in zip(forward, inverse, strict=True)]
    for i in reversed(range(size)):
        x[i] -= sum((L[k][i] * x[k] for k in range(i + 1, size)), ca.SX(0))
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
