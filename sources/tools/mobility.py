"""Mobility of a robot on wheels: how many ways it can move at once, how many it can steer to.

    delta_m = 3 - rank [C1f; C1c(beta)],   delta_s = rank C1c(beta),   delta_M = delta_m + delta_s

C1f and C1c hold a row for each fixed and each centred steerable wheel, (cos(alpha + beta),
sin(alpha + beta), l sin beta): no velocity along its axle. Off-centre steerable and Swedish wheels
restrict nothing. More steerable wheels than delta_s have to be steered so that their axles meet.

Source: Campion, Bastin, d'Andrea-Novel, IEEE Trans. Robotics and Automation 12(1), 1996, 47-62;
omnidirectional base paper, section 2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Kind = Literal["fixed", "steerable", "caster", "swedish"]

TYPES = ((3, 0), (2, 0), (2, 1), (1, 1), (1, 2))
"""The five types (delta_m, delta_s) of robots that can go where they want."""


@dataclass(frozen=True)
class Wheel:
    """A wheel at polar position (l, alpha); beta is the angle of its axle to the radius.

    Attributes:
        kind: fixed, centred steerable, off-centre steerable (caster) or Swedish.
        l: distance from the reference point [m].
        alpha: direction from the reference point [rad].
        beta: angle of the axle to the radius; of steerable wheels one angle out of many [rad].
    """

    kind: Kind
    l: float  # noqa: E741 - the field's symbol
    alpha: float
    beta: float = 0.0


@dataclass(frozen=True)
class Mobility:
    """Degrees of mobility, of steerability and of manoeuvrability."""

    delta_m: int
    delta_s: int

    @property
    def delta_M(self) -> int:
        """Degree of manoeuvrability."""
        return self.delta_m + self.delta_s


def lateral_row(wheel: Wheel, beta: float | None = None) -> Vector:
    """Row of C1 of a wheel without side slip, for (x', y', theta') in platform axes."""
    angle = wheel.beta if beta is None else beta
    direction = wheel.alpha + angle
    return np.array([math.cos(direction), math.sin(direction), wheel.l * math.sin(angle)])


def classify(wheels: Sequence[Wheel]) -> Mobility:
    """Type of a robot, at steering angles without special relations.

    Raises:
        ValueError: the fixed wheels leave at most one rotation centre.
    """
    fixed = np.array([lateral_row(w) for w in wheels if w.kind == "fixed"]).reshape(-1, 3)
    steerable = [w for w in wheels if w.kind == "steerable"]
    rank_fixed = _rank(fixed)
    if rank_fixed > 1:
        raise ValueError(
            f"the axles of the fixed wheels have rank {rank_fixed}: the robot can turn about one "
            "point at most; put all fixed wheels on one axle"
        )
    rank = rank_fixed
    for sample in range(3):  # generic angles: a special one could hide a rank
        rows = [
            lateral_row(w, w.beta + 0.37 + 1.1 * sample + 0.7 * k) for k, w in enumerate(steerable)
        ]
        rank = max(rank, _rank(np.vstack([fixed, *rows])))
    rank = min(rank, 2)  # beyond two, the wheels must be steered to a common rotation centre
    return Mobility(3 - rank, rank - rank_fixed)


def admissible_velocities(wheels: Sequence[Wheel], beta: Sequence[float]) -> Vector:
    """Basis (3 x delta_m) of the platform velocities at given angles of the steerable wheels."""
    angles = iter(beta)
    rows = [
        lateral_row(w, next(angles) if w.kind == "steerable" else None)
        for w in wheels
        if w.kind in ("fixed", "steerable")
    ]
    if not rows:
        return np.eye(3)
    matrix = np.array(rows)
    _, _, vt = np.linalg.svd(matrix)
    return np.asarray(vt[_rank(matrix) :].T)


def _rank(matrix: Vector) -> int:
    return int(np.linalg.matrix_rank(matrix, tol=1e-9)) if matrix.size else 0
