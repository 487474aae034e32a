"""The functions that a law from data is made of: those of the effect `fitted_law`, in arrays.

    u = sum_k sum_m c_km N_k(x) P_m(y)

See `sources/effects/fitted_law.py`. A shape says on which signals u depends and over which range; a
form says which of the 13 x 8 coefficients are free of each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
ALONG_X, ALONG_Y = 12, 8
"""As in the effect."""
STRAIGHT = 1e3
"""Scale over the range from which knots are equally spaced: asinh(1e-3) is 1e-3 to seven digits."""


@dataclass(frozen=True)
class Axis:
    """A signal that a law depends on.

    Attributes:
        signal: of the balance, or `time`.
        first, last: what the data visit.
        scale: around which knots are dense at 0; as `STRAIGHT` times the range if they are not.
        jump: over which the jump at 0 is smoothed.
        turn: whether the law repeats with the distance of first and last.
        fold: whether the signal counts without its sign (second ones only).
    """

    signal: str
    first: float
    last: float
    scale: float = 1e3
    jump: float = 1e-2
    turn: bool = False
    fold: bool = False

    @property
    def label(self) -> str:
        """As shown."""
        return f"|{self.signal}|" if self.fold else self.signal

    @property
    def range(self) -> float:
        """Width of what the data visit."""
        return self.last - self.first

    def along_x(self, values: Vector) -> Vector:
        """N_k (columns) at values of x."""
        bent = np.arcsinh(np.array([self.first, self.last]) / self.scale)
        place = (np.arcsinh(values / self.scale) - bent[0]) / (bent[1] - bent[0])
        count = ALONG_X - 3
        place = np.clip(count * place, 0.0, count)[:, None]
        smooth = spline(place - (np.arange(ALONG_X) - 1.0))
        return np.column_stack([smooth, np.tanh(values / self.jump)])

    def along_y(self, values: Vector) -> Vector:
        """P_m (columns) at values of y."""
        values = np.abs(values) if self.fold else values
        place = (values - self.first) / self.range
        if self.turn:
            away = (ALONG_Y * place)[:, None] - np.arange(ALONG_Y)
            return spline(away - ALONG_Y * np.floor(away / ALONG_Y + 0.5))
        count = ALONG_Y - 3
        return spline(np.clip(count * place, 0.0, count)[:, None] - np.arange(ALONG_Y) + 1.0)


def spline(away: Vector) -> Vector:
    """Cubic B-spline on knots one apart, this far from its middle."""
    near = np.maximum(1.0 - np.abs(away), 0.0)
    far = np.maximum(2.0 - np.abs(away), 0.0)
    return np.asarray((far**3 - 4.0 * near**3) / 6.0)


def kron(first: Vector, second: Vector) -> Vector:
    """Kronecker product."""
    return np.asarray(np.kron(first, second), dtype=np.float64)


@dataclass(frozen=True)
class Shape:
    """What a law depends on and in which form.

    Attributes:
        form: "x", "y" or "x * y": depends on x, on y, on both in any way.
        x, y: signals; one that the form does not have is None.
    """

    form: str
    x: Axis | None = None
    y: Axis | None = None

    @property
    def axes(self) -> tuple[Axis, ...]:
        """Those of the form."""
        return tuple(axis for axis in (self.x, self.y) if axis is not None)

    @property
    def label(self) -> str:
        """As shown."""
        return " x ".join(axis.label for axis in self.axes)

    @cached_property
    def expansion(self) -> Vector:
        """Coefficients c (rows) of the free ones (columns)."""
        ones = np.ones((ALONG_Y, 1)), np.ones((ALONG_X + 1, 1))
        only_x = kron(np.eye(ALONG_X + 1), ones[0])
        only_y = kron(ones[1], np.eye(ALONG_Y))
        only_y[ALONG_X * ALONG_Y :] = 0.0  # a jump of x is none of y
        if self.form == "x":
            return only_x
        if self.form == "y":
            return only_y
        return np.eye((ALONG_X + 1) * ALONG_Y)

    @property
    def jumps(self) -> NDArray[np.bool_]:
        """Which of the free coefficients are jumps."""
        return np.asarray(np.any(self.expansion[ALONG_X * ALONG_Y :] != 0.0, axis=0))

    def penalties(self) -> list[Vector]:
        """Squares of second differences along each axis, as matrices over the free coefficients."""
        along_x = np.zeros((ALONG_X - 2, ALONG_X + 1))
        for row in range(ALONG_X - 2):
            along_x[row, row : row + 3] = 1.0, -2.0, 1.0
        circle = self.y is not None and self.y.turn
        along_y = np.zeros((ALONG_Y if circle else ALONG_Y - 2, ALONG_Y))
        for row in range(along_y.shape[0]):
            for place, value in enumerate((1.0, -2.0, 1.0)):
                along_y[row, (row + place) % ALONG_Y] += value
        x, y = along_x.T @ along_x, along_y.T @ along_y
        if self.form == "x":
            return [x]
        if self.form == "y":
            return [y]
        return [kron(x, np.eye(ALONG_Y)), kron(np.eye(ALONG_X + 1), y)]

    def design(self, x: Vector, y: Vector) -> Vector:
        """Values of the free coefficients' functions (columns) at points."""
        along_x = np.zeros((x.size, ALONG_X + 1)) if self.x is None else self.x.along_x(x)
        along_y = np.zeros((y.size, ALONG_Y)) if self.y is None else self.y.along_y(y)
        if self.form == "x":
            return along_x
        if self.form == "y":
            return along_y
        return np.asarray((along_x[:, :, None] * along_y[:, None, :]).reshape(x.size, -1))
