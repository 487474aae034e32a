"""Backlash: the spring transmits nothing within a gap, and its damper only part.

    f = k sat(x, gap / 2) + (1 - grease) d x' where |x| < gap / 2
    the spring's torque becomes k (x - sat(x, gap / 2)) + d x' outside, grease d x' inside
    E = k ((x - sat)^2 - x^2) / 2, less than the spring without gap
    P_loss = -(1 - grease) d x'^2 inside, less than the damper without gap

Other effects on the spring act on x - sat, and not at all inside: teeth that do not touch transmit
nothing.

Not modelled: impact losses beyond those of the damper.

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
GREASE = Quantity(
    "grease", "1", "share of the spring's damper that acts within the gap", minimum=0.0, maximum=1.0
)

EFFECT = Effect(
    "backlash",
    "Play in a spring.",
    ("compliance",),
    GAP,
    needs=("stiffness",),
    alone=True,
    first=True,
    source="Nordin 1997",
)


def law(e: EffectModel) -> None:
    """Add what the spring and its damper do not transmit."""
    x, half, k = e.signal("deflection"), e.parameter(GAP) / 2, e.signal("stiffness")
    # strict: without a gap the derivative at rest is the spring's, too
    within = ca.fabs(x) < half
    sat = ca.if_else(within, x, half * ca.sign(x))
    touching = 1 - within
    e.add(k * sat)
    e.stored_energy(-k * sat * (2 * x - sat) / 2)
    x_dot = e.signal("rate")
    if e.offers("damping"):
        grease, d = e.parameter(GREASE), e.signal("damping")
        idle = within * (1 - grease) * d * x_dot
        e.add(idle)
        e.loss(-idle * x_dot)
    else:
        e.loss(0)
    e.pass_on(touching, deflection=x - sat, rate=touching * x_dot)
