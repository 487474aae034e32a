"""Transform between two frames in which the same points were measured.

    three points   x^ = (p_B - p_A)/|.|,  z^ = (p_B - p_A) x (p_C - p_A)/|.|,  y^ = z^ x x^
                   A_a = [x^ y^ z^ p_A; 0 0 0 1] in each frame,  A_m^o = A_a^o (A_a^m)^-1
    least squares  rotation and translation that minimise the sum of squared distances (Kabsch)

The three-point form takes the heading from A and B alone; least squares uses every point.

Source: digital twin paper, Eq 2 to 5 (p_b, p_a in Eq 3 are p_B, p_A); Kabsch, Acta Cryst. A32
(1976), 922.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Matrix = NDArray[np.float64]


_APART = 1e-9
"""Distance from a line, relative to the length along it, that is no more than rounding."""


def _triad(points: Matrix) -> Matrix:
    a, b, c = points
    x = (b - a) / np.linalg.norm(b - a)
    normal = np.cross(b - a, c - a)
    size = np.linalg.norm(normal)
    if size < _APART * np.linalg.norm(b - a) * np.linalg.norm(c - a):
        raise ValueError("points A, B and C lie on one line and define no frame")
    z = normal / size
    frame = np.eye(4)
    frame[:3] = np.column_stack([x, np.cross(z, x), z, a])
    return frame


def three_point(measured: ArrayLike, reference: ArrayLike) -> Matrix:
    """Homogeneous transform (4x4) from the measured frame to the reference frame.

    Args:
        measured, reference: points A, B, C as rows (3x3) in either frame [m].

    Raises:
        ValueError: the points lie on one line.
    """
    m, o = np.asarray(measured, dtype=float), np.asarray(reference, dtype=float)
    return np.asarray(_triad(o) @ np.linalg.inv(_triad(m)))


def kabsch(measured: ArrayLike, reference: ArrayLike) -> Matrix:
    """Least-squares rigid transform, homogeneous, in the plane (3x3) or in space (4x4).

    Args:
        measured, reference: points as rows (n x 2 or n x 3) in either frame [m].

    Raises:
        ValueError: shapes that differ, too few points or such that are not finite, or points that
            define no rotation: all in one place or, in space, on one line.
    """
    m, o = np.asarray(measured, dtype=float), np.asarray(reference, dtype=float)
    if m.shape != o.shape or m.ndim != 2:
        raise ValueError(f"point sets have shapes {m.shape} and {o.shape}")
    count, size = m.shape
    if count < size:
        raise ValueError(f"{count} points define no transform in {size} dimensions")
    if not (np.isfinite(m).all() and np.isfinite(o).all()):
        raise ValueError("points of either frame have values that are not finite")
    middle_m, middle_o = m.mean(axis=0), o.mean(axis=0)
    for points in (m - middle_m, o - middle_o):
        if np.linalg.matrix_rank(points, tol=_APART * np.abs(points).max(initial=0.0)) < size - 1:
            raise ValueError(
                "points in one place, or on one line in space, define no rotation; "
                "measure one that lies apart"
            )
    u, _, vt = np.linalg.svd((m - middle_m).T @ (o - middle_o))
    signs = np.ones(size)
    signs[-1] = np.sign(np.linalg.det(u @ vt))  # a rotation, never a reflection
    rotation = vt.T @ np.diag(signs) @ u.T
    transform = np.eye(size + 1)
    transform[:size, :size] = rotation
    transform[:size, size] = middle_o - rotation @ middle_m
    return transform
