"""Viscous drag on the motion of a body, e.g. of something that it pulls along.

    F = -c v,   P_loss = c |v|^2

at the reference point.

Not modelled: a moment, dry friction.

Source: linear damping.
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

C = Quantity(
    "c", "N.s/m", "drag force per velocity, 0 = absent", start=10.0, minimum=0.0, strength=True
)

EFFECT = Effect("body_drag", "Viscous drag on a body.", ("body",), C, source="linear damping")


def law(e: EffectModel) -> None:
    """Add the drag."""
    c, v = e.parameter(C), e.signal("velocity")
    F = -c * v
    e.add(ca.vertcat(F, ca.SX.zeros(3)))
    e.loss(-ca.dot(F, v))
