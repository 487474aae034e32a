"""Planar frames: rotation about the vertical."""

from __future__ import annotations

from typing import Any

import casadi as ca

SX = Any


def rotated(angle: SX, x: SX, y: SX) -> tuple[SX, SX]:
    """The vector (x, y) turned by `angle`, positive counter-clockwise."""
    c, s = ca.cos(angle), ca.sin(angle)
    return c * x - s * y, s * x + c * y
