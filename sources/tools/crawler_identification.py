"""Virtual wheels of a tracked vehicle from measured turns: V-axis, e2 and e3, constants, slip laws.

    V-axis       x_a = (L^2 + d_a^2/4 - d_b^2/4)/(2 L),  h = sqrt(d_a^2/4 - x_a^2)
    R            sqrt(R_S^2 - l_Sx^2) - l_Sy
    e2, e3       r w2/w_z - R - B/2,   R - r w3/w_z - B/2

Source: crawler paper, section 5 and Eq 24 and 25 (sign of l_Sy in the second line of Eq 25
corrected, see `sources/crawler/README.md`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq, least_squares

Vector = NDArray[np.float64]


class Circle(NamedTuple):
    """Centre [m] and radius [m]."""

    x: float
    y: float
    radius: float


def fit_circle(x: ArrayLike, y: ArrayLike) -> Circle:
    """Least-squares circle through points, by the distances to it."""
    px, py = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    rows = np.column_stack([2 * px, 2 * py, np.ones_like(px)])
    (cx, cy, c), *_ = np.linalg.lstsq(rows, px**2 + py**2, rcond=None)
    start = [cx, cy, np.sqrt(c + cx**2 + cy**2)]
    found = least_squares(lambda p: np.hypot(px - p[0], py - p[1]) - p[2], start, x_scale="jac")
    return Circle(*(float(v) for v in found.x))


class Axis(NamedTuple):
    """Rotation centre seen from a pair of markers.

    Attributes:
        h: distance of the centre from the line through the markers [m].
        offset: foot of the perpendicular from the pair's midpoint, positive towards b [m].
    """

    h: Vector
    offset: Vector


def v_axis(d_a: ArrayLike, d_b: ArrayLike, spacing: float) -> Axis:
    """Rotation centre from the diameters of two markers' paths in a turn on the spot.

    Args:
        d_a, d_b: diameters of the paths of markers a and b [m].
        spacing: distance between the markers [m].
    """
    a, b = np.asarray(d_a, dtype=float) / 2, np.asarray(d_b, dtype=float) / 2
    along = (spacing**2 + a**2 - b**2) / (2 * spacing)
    return Axis(np.sqrt(a**2 - along**2), along - spacing / 2)


def spacing_of_row(d_a: float, d_b: float, h: float) -> float:
    """Marker spacing that one printed row (diameters and h) implies [m]."""
    return float(np.sqrt(d_a**2 / 4 - h**2) + np.sqrt(d_b**2 / 4 - h**2))


def fit_spacing(d_a: ArrayLike, d_b: ArrayLike, h: ArrayLike) -> tuple[float, Vector]:
    """Marker spacing that fits all rows best [m], and the residuals model - printed of h [m]."""
    measured = np.asarray(h, dtype=float)

    def residual(p: Vector) -> Vector:
        return np.asarray(v_axis(d_a, d_b, float(p[0])).h - measured)

    found = least_squares(residual, [0.18], x_scale=0.01, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return float(found.x[0]), np.asarray(residual(found.x))


@dataclass(frozen=True)
class Constants:
    """What the paper's formula needs: r, B, l_Sx and l_Sy [m]."""

    r: float = 0.0310
    B: float = 0.1900
    l_Sx: float = 0.0775
    l_Sy: float = 0.0


@dataclass(frozen=True)
class Turns:
    """Steady turns: wheel speeds and yaw rate [rad/s], radius of point S [m], label of the set."""

    w2: Vector
    w3: Vector
    w_z: Vector
    R_S: Vector
    group: NDArray[np.int_]

    def where(self, chosen: NDArray[np.bool_]) -> Turns:
        """Some of the rows."""
        return Turns(
            self.w2[chosen], self.w3[chosen], self.w_z[chosen], self.R_S[chosen], self.group[chosen]
        )


def shifts(turns: Turns, c: Constants) -> tuple[Vector, Vector]:
    """e2 and e3 [m] of steady turns."""
    radius = np.sqrt(turns.R_S**2 - c.l_Sx**2) - c.l_Sy
    e2 = c.r * turns.w2 / turns.w_z - radius - c.B / 2
    e3 = radius - c.r * turns.w3 / turns.w_z - c.B / 2
    return e2, e3


def predict(turns: Turns, e2: ArrayLike, e3: ArrayLike, c: Constants) -> tuple[Vector, Vector]:
    """Yaw rate [rad/s] and radius of S [m] that shifts e2, e3 give at the speeds of the turns."""
    span = c.B + np.asarray(e2) + np.asarray(e3)
    w_z = c.r * (turns.w2 - turns.w3) / span
    radius = ((c.B / 2 + np.asarray(e3)) * turns.w2 + (c.B / 2 + np.asarray(e2)) * turns.w3) / (
        turns.w2 - turns.w3
    )
    return w_z, np.hypot(c.l_Sx, radius + c.l_Sy)


def skid_coefficients(turns: Turns, e2: Vector, e3: Vector, c: Constants) -> tuple[Vector, Vector]:
    """i_R and i_L of (forward) turns; nan where a locked track leaves them undefined."""
    forward = c.r * turns.w3
    with np.errstate(invalid="ignore", divide="ignore"):
        i_right = _skid(c.r * turns.w2, e2 * turns.w_z)
        i_left = np.where(forward == 0, np.nan, _skid(forward, -e3 * turns.w_z))
    return i_right, i_left


def _skid(belt: Vector, lost: Vector) -> Vector:
    return np.asarray(lost / np.maximum(np.abs(belt), np.abs(belt - lost)))


def shifts_from_skid(
    turns: Turns, i_right: Vector, i_left: Vector, c: Constants
) -> tuple[Vector, Vector]:
    """e2 and e3 from skid coefficients, the inverse of `skid_coefficients`."""
    right, left = c.r * turns.w2, c.r * turns.w3
    return (right - _floor_speed(right, i_right)) / turns.w_z, (
        _floor_speed(left, i_left) - left
    ) / turns.w_z


def _floor_speed(belt: Vector, i: Vector) -> Vector:
    return np.asarray(np.where(i >= 0, belt * (1 - i), belt / (1 + np.minimum(i, 0))))


@dataclass(frozen=True)
class Rounding:
    """Half a unit of the last printed digit of w2, w3 [rad/s], w_z [rad/s], R_S, e2 and e3 [m]."""

    w2: Vector
    w3: Vector
    w_z: float
    R_S: float
    e2: float
    e3: Vector


def rounding_bounds(turns: Turns, c: Constants, half: Rounding) -> tuple[Vector, Vector]:
    """Largest |computed - printed| of e2 and e3 [m] that the rounding of the table can cause."""
    slope = turns.R_S / np.sqrt(turns.R_S**2 - c.l_Sx**2) * half.R_S
    per_rate = c.r / turns.w_z
    right = per_rate * (half.w2 + turns.w2 / turns.w_z * half.w_z)
    left = per_rate * (half.w3 + turns.w3 / turns.w_z * half.w_z)
    return right + slope + half.e2, left + slope + half.e3


def fit_constants(
    turns: Turns, e2: Vector, e3: Vector, *, symmetric: bool = False
) -> tuple[Constants, float]:
    """Constants behind printed shifts, and the residual standard deviation [m].

    Args:
        turns, e2, e3: the printed table.
        symmetric: fix l_Sy = 0.
    """
    count = 3 if symmetric else 4

    def residual(p: Vector) -> Vector:
        a, b = shifts(turns, Constants(*p))
        return np.concatenate([a - e2, b - e3])

    found = least_squares(
        residual,
        [0.03, 0.2, 0.08, 0.001][:count],
        x_scale=[0.03, 0.2, 0.08, 0.01][:count],
        xtol=1e-14,
        ftol=1e-14,
        gtol=1e-14,
    )
    deviation = float(np.sqrt(np.sum(found.fun**2) / (found.fun.size - count)))
    return Constants(*(float(v) for v in found.x)), deviation


Law = Callable[[Turns, Vector, Vector], Callable[[Turns], tuple[Vector, Vector]]]
"""Fits a slip law to turns with known e2, e3 and returns what it predicts for others."""


def _linear(columns: Callable[[Turns], Vector], constant_e3: bool) -> Law:
    def fit(turns: Turns, e2: Vector, e3: Vector) -> Callable[[Turns], tuple[Vector, Vector]]:
        weights, *_ = np.linalg.lstsq(columns(turns), e2, rcond=None)
        inner = float(np.mean(e3)) if constant_e3 else 0.0
        return lambda other: (columns(other) @ weights, np.full_like(other.w2, inner))

    return fit


def _one(t: Turns) -> Vector:
    return np.ones_like(t.w2)


LAWS: dict[str, Law] = {
    "e2 = c, e3 = 0": _linear(lambda t: _one(t)[:, None], False),
    "e2 = c2, e3 = c3": _linear(lambda t: _one(t)[:, None], True),
    "e2 = a + b rho, e3 = 0": _linear(lambda t: np.column_stack([_one(t), t.w3 / t.w2]), False),
    "e2 = a + b (w2 - w3), e3 = 0": _linear(
        lambda t: np.column_stack([_one(t), t.w2 - t.w3]), False
    ),
    "e2 = a + b w3, e3 = 0": _linear(lambda t: np.column_stack([_one(t), t.w3]), False),
}
"""Slip laws that are linear in their parameters."""


@dataclass(frozen=True)
class Misfit:
    """Rms over the rows: e2, e3 [m], radius R_S and yaw rate relative to the measured ones [1]."""

    e2: float
    e3: float
    R_S: float
    w_z: float


def leave_one_set_out(law: Law, turns: Turns, e2: Vector, e3: Vector, c: Constants) -> Misfit:
    """Misfit of a slip law on sets of runs that it was not fitted to."""
    found2, found3 = np.empty_like(e2), np.empty_like(e3)
    for group in np.unique(turns.group):
        held = turns.group == group
        model = law(turns.where(~held), e2[~held], e3[~held])
        found2[held], found3[held] = model(turns.where(held))
    w_z, radius = predict(turns, found2, found3, c)

    def rms(values: Vector) -> float:
        return float(np.sqrt(np.mean(values**2)))

    return Misfit(
        rms(found2 - e2),
        rms(found3 - e3),
        rms(radius / turns.R_S - 1),
        rms(w_z / turns.w_z - 1),
    )


def quasi_static_shift(track: float, length: float) -> float:
    """Shift e2 = e3 [m] at which uniform Coulomb friction balances on two equally loaded tracks.

    (B/2) X(e) = Y(e),  X = (2e/l) asinh(l/2e),
    Y = ((l/2) sqrt(l^2/4 + e^2) - e^2 asinh(l/2e))/l

    Args:
        track: distance B between the track centre lines [m].
        length: contact length l of a track [m].
    """

    def excess(e: float) -> float:
        s = np.arcsinh(length / (2 * e))
        along = 2 * e / length * s
        yaw = (length / 2 * np.hypot(length / 2, e) - e**2 * s) / length
        return float(track / 2 * along - yaw)

    return float(brentq(excess, 1e-9, 10 * length, xtol=1e-15))
