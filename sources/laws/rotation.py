"""Rotations in space by quaternions w, x, y, z (body axes to world) of any length but 0.

    R = 1 + s (w [v]x + [v]x [v]x),   s = 2/|q|^2,   v = (x, y, z)
    q' = q (0, w)/2   for the angular velocity w in body axes

Source: Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 4.5.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

SX = Any

TINY = 1e-32  # square of half an angle below which the rotation vector's direction fades to 0


def rotation_matrix(q: SX) -> SX:
    """Rotation matrix R, body to world."""
    w, x, y, z = (q[i] for i in range(4))
    s = 2 / ca.dot(q, q)
    return ca.vertcat(
        ca.horzcat(1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)),
        ca.horzcat(s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)),
        ca.horzcat(s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)),
    )


def product(first: SX, second: SX) -> SX:
    """Quaternion of the rotation that turns by `second`, then by `first` (both in fixed axes)."""
    a, b, c, d = (first[i] for i in range(4))
    w, x, y, z = (second[i] for i in range(4))
    return ca.vertcat(
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


def quaternion_rate(q: SX, w: SX) -> SX:
    """Time derivative q' of a quaternion for an angular velocity in body axes."""
    return product(q, ca.vertcat(0, w)) / 2


def rotation_vector(q: SX) -> SX:
    """Axis times angle, with an angle up to pi."""
    w, v = q[0], q[1:]
    length = ca.sqrt(ca.dot(v, v) + TINY * ca.dot(q, q))
    angle = 2 * ca.atan2(length, ca.fabs(w))
    return ca.if_else(w < 0, -1.0, 1.0) * angle / length * v
