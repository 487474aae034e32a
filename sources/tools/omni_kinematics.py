"""Kinematics of a base on off-centre steerable wheels, in numbers.

    beta' = -(1/e) C1 R xi',  phi' = -(1/r) J1 R xi'           (inverse)
    xi' = R^T pinv([K_beta; K_phi]) [beta'; phi']              (forward, least squares of all rates)

Source: omnidirectional base paper, Eq 2 and 14 to 16 (Eq 14, third column corrected).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Base:
    """Geometry: steering axes (n each) [m], caster offset and wheel radius [m]."""

    x: tuple[float, ...]
    y: tuple[float, ...]
    e: float
    r: float

    @classmethod
    def symmetric(cls, distance: float, angles: Sequence[float], e: float, r: float) -> Base:
        """Steering axes at one distance in the given directions [rad]."""
        x = tuple(float(distance * np.cos(a)) for a in angles)
        return cls(x, tuple(float(distance * np.sin(a)) for a in angles), e, r)


def rotation(theta: float) -> Matrix:
    """R: world rates (x', y', theta') to platform axes."""
    c, s = np.cos(theta), np.sin(theta)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def constraint_rows(base: Base, beta: ArrayLike) -> tuple[Matrix, Matrix]:
    """J1 and C1 (n x 3)."""
    b, x, y = np.asarray(beta, dtype=float), np.array(base.x), np.array(base.y)
    c, s = np.cos(b), np.sin(b)
    j1 = np.column_stack([c, s, x * s - y * c])
    return j1, np.column_stack([s, -c, base.e - x * c - y * s])


def joint_map(base: Base, beta: ArrayLike) -> Matrix:
    """[K_beta; K_phi] (2n x 3): joint rates from the velocity in platform axes."""
    j1, c1 = constraint_rows(base, beta)
    return np.vstack([-c1 / base.e, -j1 / base.r])


def inverse(base: Base, theta: float, beta: ArrayLike, rates: ArrayLike) -> tuple[Matrix, Matrix]:
    """Steering and spin rates for the velocity xi' (3) in the world."""
    joint = joint_map(base, beta) @ rotation(theta) @ np.asarray(rates, dtype=float)
    return joint[: len(base.x)], joint[len(base.x) :]


def forward(
    base: Base, theta: float, beta: ArrayLike, beta_rate: ArrayLike, phi_rate: ArrayLike
) -> tuple[Matrix, float]:
    """Velocity xi' (3) in the world that fits all joint rates best, and the rms misfit [rad/s].

    A misfit above the noise of the encoders shows slip or a wrong geometry.
    """
    joint = np.concatenate([np.asarray(beta_rate, float), np.asarray(phi_rate, float)])
    matrix = joint_map(base, beta)
    u, *_ = np.linalg.lstsq(matrix, joint, rcond=None)
    misfit = float(np.sqrt(np.mean((matrix @ u - joint) ** 2)))
    return np.asarray(rotation(theta).T @ u), misfit


def least_singular_value(
    base: Base, beta: ArrayLike, steering: Sequence[int] = (), rolling: Sequence[int] = ()
) -> float:
    """Smallest singular value [1/m] of the map to the rates of the chosen motors.

    0 means that these motors cannot determine the motion: a singular configuration.

    Args:
        base: geometry.
        beta: steering angles [rad].
        steering, rolling: indices (from 0) of the wheels whose steering and rolling motors count.
    """
    count = len(base.x)
    rows = [*steering, *(count + k for k in rolling)]
    if len(rows) < 3:
        return 0.0
    return float(np.linalg.svd(joint_map(base, beta)[rows], compute_uv=False)[-1])
