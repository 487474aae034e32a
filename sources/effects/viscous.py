"""Viscous friction on top of what a component declares.

    f = -b v,   P_loss = b v^2

Not modelled: dependence on temperature (`temperature_drift`) or load.

Source: Armstrong-Helouvry, Control of Machines with Friction, 1991, ch. 2.
"""

from __future__ import annotations

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

B = Quantity(
    "b",
    "N.m.s/rad",
    "additional viscous friction, 0 = absent",
    start=0.05,
    minimum=0.0,
    strength=True,
)

EFFECT = Effect(
    "viscous", "Viscous friction of a shaft.", ("rotation",), B, source="Armstrong 1991"
)


def law(e: EffectModel) -> None:
    """Add the friction torque."""
    b, v = e.parameter(B), e.signal("velocity")
    f = -b * v
    e.add(f)
    e.loss(-f * v)
