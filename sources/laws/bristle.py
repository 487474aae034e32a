"""Elasto-plastic bristle: friction that sticks elastically and slides beyond a small deflection.

    x_0 z' = v (1 - a |z| / h)   where v z > 0,   x_0 z' = v   elsewhere
    a rises smoothly from 0 at |z| <= z_stick to 1 at |z| >= h

z is the deflection over x_0; h is 1 for Coulomb friction and more where it takes more to break
away. z_stick is 0.7 h.
Below z_stick the bristle is a spring: no drift under a load that varies, unlike in LuGre's model.

Source: Dupont, Hayward, Armstrong, Altpeter, Single state elasto-plastic friction models, IEEE
Trans. Automatic Control 47(5), 2002.
"""

from __future__ import annotations

import casadi as ca

from ..model import SX

STICK = 0.7
"""Deflection, relative to the sliding one, below which nothing slides."""


def bristle(v: SX, z: SX, h: SX, x_0: SX) -> tuple[SX, SX]:
    """Rate z' of the relative deflection, and the share `a` of sliding (0 stuck, 1 sliding)."""
    size = ca.fabs(z)
    z_stick = STICK * h
    x = ca.fmax(0, ca.fmin((size - z_stick) / (h - z_stick), 1))
    a = ca.if_else(v * z > 0, x**2 * (3 - 2 * x), 0)
    return v / x_0 * (1 - a * size / h), a
