"""Drag that grows with the square of speed: a fan, or oil that is churned.

    f = -c v |v|,   P_loss = c |v|^3

Not modelled: Reynolds number, swirl left by an earlier motion.

Source: affinity laws of fans, e.g. Eck, Fans, 1973, ch. 3.
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

C = Quantity(
    "c",
    "N.m.s2/rad2",
    "drag torque per speed squared, 0 = absent",
    start=0.005,
    minimum=0.0,
    strength=True,
)

EFFECT = Effect(
    "quadratic_drag",
    "Drag of a shaft with the square of its speed.",
    ("rotation",),
    C,
    source="Eck 1973",
)


def law(e: EffectModel) -> None:
    """Add the drag torque."""
    c, v = e.parameter(C), e.signal("velocity")
    f = -c * v * ca.fabs(v)
    e.add(f)
    e.loss(-f * v)
