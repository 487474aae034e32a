"""Newton's method for z = G(z), with a Jacobian that is kept as long as it contracts:

    (I - dG/dz) (z_new - z) = G(z) - z

Plain numbers and a fixed order of summation, so that compiled code can do the same, bit for bit.

Source: Kelley, Solving nonlinear equations with Newton's method, 2003 (chord method).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from ..system.system import System

Vector = NDArray[np.float64]
ITERATIONS = 60
"""Newton iterations before a loop is said not to settle."""
SETTLED = 1e-10
"""Newton step, relative to max(floor, |z|), at which a loop counts as solved."""
CONTRACTION = 0.25
"""The Jacobian is renewed when a Newton step is longer than this times the one before."""
INCREMENT = 1e-6
"""Of differences, relative to max(floor, |z|)."""
SETTLED_SINGLE, INCREMENT_SINGLE = 1e-6, 1e-3
"""The same two where a value is a Float32, which carries 6e-8: more than ten times that, for what a
loop makes of its rounding, and differences that are large beside it."""


def single(system: System, names: Iterable[str]) -> bool:
    """Whether one of these variables is a Float32."""
    return any(system.declaration(name).type == "Float32" for name in names)


def floor(system: System, names: Iterable[str]) -> Vector:
    """Sizes of variables below which errors are not relative: 1, or a smaller nominal value."""
    return np.array([min(1.0, abs(system.declaration(name).nominal or 1.0)) for name in names])


class Newton:
    """Solves z = G(z), keeping the inverse of I - dG/dz.

    Args:
        floor: size of each unknown below which errors are not relative: see `floor`.
        single: whether a value is a Float32.
        tolerance: relative error; of what is `single` not less than its resolution allows.

    Attributes:
        inverse: n x n.
        valid: one number, whether `inverse` is good for anything.
    """

    def __init__(self, floor: Vector, single: bool, tolerance: float = SETTLED) -> None:
        self.n, self.floor = floor.size, floor
        self.tolerance = max(tolerance, SETTLED_SINGLE) if single else tolerance
        self.increment = INCREMENT_SINGLE if single else INCREMENT
        self.inverse = np.zeros((self.n, self.n))
        self.valid = np.zeros(1, dtype=np.int64)

    def keep(self, jacobian: Vector) -> bool:
        """Take dG/dz; False if I - dG/dz is singular."""
        inverse = invert((np.eye(self.n) - jacobian).tolist())
        self.valid[0] = inverse is not None
        if inverse is not None:
            self.inverse[:] = inverse
        return inverse is not None

    def solve(self, function: Callable[[list[float]], list[float]], z: list[float]) -> bool:
        """Find z = G(z) from the guess `z`, which is overwritten; the last call was of G(z).

        Returns:
            Whether it settled.
        """
        last = 0.0
        for _ in range(ITERATIONS):
            value = function(z)
            rest = [a - b for a, b in zip(value, z, strict=True)]
            renewed = False
            if not self.valid[0]:
                if not self.difference(function, z, value):
                    return False
                renewed = True
            size, change = self.newton_step(rest, z)
            if size <= self.tolerance and not renewed:
                return True
            if not renewed and last > 0.0 and not size <= CONTRACTION * last:
                if not self.difference(function, z, value):
                    return False
                size, change = self.newton_step(rest, z)
            if not size < np.inf:
                self.valid[0] = 0
                return False
            for i in range(self.n):
                z[i] += change[i]
            last = size
        self.valid[0] = 0
        return False

    def newton_step(self, rest: list[float], z: list[float]) -> tuple[float, list[float]]:
        """The change of z and its relative size."""
        with np.errstate(all="ignore"):
            # each sum is made in the order of its row and begins with 0, as in compiled code
            sums = np.add.accumulate(self.inverse * np.array(rest), axis=1)
            total = sums[:, -1] + 0.0 if self.n else np.zeros(0)
            relatives = np.abs(total) / np.fmax(self.floor, np.abs(z))
        size = 0.0
        for relative in relatives.tolist():
            if not relative <= size:  # so that nan counts as large
                size = relative
        return size, total.tolist()

    def difference(
        self, function: Callable[[list[float]], list[float]], z: list[float], value: list[float]
    ) -> bool:
        """Renew the Jacobian by differences around z."""
        n = self.n
        matrix = [[0.0] * n for _ in range(n)]
        for j in range(n):
            moved = list(z)
            increment = self.increment * max(float(self.floor[j]), abs(z[j]))
            moved[j] += increment
            there = function(moved)
            for i in range(n):
                matrix[i][j] = (1.0 if i == j else 0.0) - (there[i] - value[i]) / increment
        inverse = invert(matrix)
        self.valid[0] = inverse is not None
        if inverse is not None:
            self.inverse[:] = inverse
        return inverse is not None


def invert(matrix: list[list[float]]) -> list[list[float]] | None:
    """Inverse by Gauss-Jordan elimination with partial pivoting, None if there is none."""
    n = len(matrix)
    rows = np.hstack([np.array(matrix).reshape(n, n), np.eye(n)])
    with np.errstate(all="ignore"):
        for k in range(n):
            sizes = np.abs(rows[k:, k])
            best = k if np.isnan(sizes[0]) else k + int(np.nanargmax(sizes))  # the first of equals
            pivot = float(rows[best, k])
            if not 1e-13 < abs(pivot) < np.inf:
                return None
            rows[[k, best]] = rows[[best, k]]
            rows[k] /= pivot
            others = np.flatnonzero(rows[:, k])
            others = others[others != k]
            rows[others] -= rows[others, k, None] * rows[k]
    inverse: list[list[float]] = rows[:, n:].tolist()
    return inverse
