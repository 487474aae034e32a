"""Backlash: the spring transmits nothing within a gap.

    f = k sat(x, gap / 2),   the spring's torque becomes k (x - sat(x, gap / 2))
    E = k ((x - sat)^2 - x^2) / 2, less than the spring without gap

Not modelled: impact losses; the damper of the spring acts in the gap, too, as grease would.

Source: Nordin, Galic, Gutman, New models for backlash and gear play, Int. J. Adaptive Control and
Signal Processing 11(1), 1997 (dead-zone model).
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

GAP = Quantity(
    "gap", "rad", "whole play, 0 = absent", start=3e-3, minimum=0.0, nominal=1e-3, strength=True
)

EFFECT = Effect(
    "backlash",
    "Play in a spring.",
    ("compliance",),
    GAP,
    needs=("stiffness",),
    source="Nordin 1997",
)


def law(e: EffectModel) -> None:
    """Add what the spring does not transmit."""
    twist, half, stiffness = e.signal("deflection"), e.parameter(GAP) / 2, e.signal("stiffness")
    # strict: without a gap the derivative at rest is the spring's, too
    inside = ca.if_else(ca.fabs(twist) < half, twist, half * ca.sign(twist))
    e.add(stiffness * inside)
    e.stored_energy(-stiffness * inside * (2 * twist - inside) / 2)
    e.loss(0)
