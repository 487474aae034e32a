"""Rigid body moving in a plane, reference point away from the mass centre.

    m a_x - s_y w' - s_x w^2 = F_x
    m a_y + s_x w' - s_y w^2 = F_y
    J w' + s_x a_y - s_y a_x = M

in body axes: `a` is the acceleration of the reference point, s the first moment (mass times
position of the mass centre) and J the inertia about the reference point. For the rates of the
velocity components in body axes: v_x' = a_x + w v_y, v_y' = a_y - w v_x.

Source: Newton-Euler equations, e.g. Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 2.
"""

from __future__ import annotations

from typing import Any

SX = Any


def accelerations(
    m: SX, s_x: SX, s_y: SX, J: SX, F_x: SX, F_y: SX, M: SX, w: SX
) -> tuple[SX, SX, SX]:
    """Acceleration (a_x, a_y) of the reference point in body axes, and w'."""
    x, y = F_x + s_x * w**2, F_y + s_y * w**2
    central = J - (s_x**2 + s_y**2) / m  # about the mass centre
    w_dot = (M - (s_x * y - s_y * x) / m) / central
    return (x + s_y * w_dot) / m, (y - s_x * w_dot) / m, w_dot


def kinetic_energy(m: SX, s_x: SX, s_y: SX, J: SX, v_x: SX, v_y: SX, w: SX) -> SX:
    """Kinetic energy [J] from the velocity of the reference point (body axes) and the rate."""
    return m * (v_x**2 + v_y**2) / 2 + w * (s_x * v_y - s_y * v_x) + J * w**2 / 2
