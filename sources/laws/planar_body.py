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
    mass: SX, s_x: SX, s_y: SX, inertia: SX, force_x: SX, force_y: SX, moment: SX, rate: SX
) -> tuple[SX, SX, SX]:
    """Acceleration of the reference point (body axes) and angular acceleration."""
    x, y = force_x + s_x * rate**2, force_y + s_y * rate**2
    central = inertia - (s_x**2 + s_y**2) / mass
    angular = (moment - (s_x * y - s_y * x) / mass) / central
    return (x + s_y * angular) / mass, (y - s_x * angular) / mass, angular


def kinetic_energy(mass: SX, s_x: SX, s_y: SX, inertia: SX, v_x: SX, v_y: SX, rate: SX) -> SX:
    """Kinetic energy [J] from the velocity of the reference point (body axes) and the rate."""
    return mass * (v_x**2 + v_y**2) / 2 + rate * (s_x * v_y - s_y * v_x) + inertia * rate**2 / 2
