"""Voltage drop of the brushes, or of power switches, against the current's direction.

    f = -u_b tanh(i / i_0),   P_loss = u_b i tanh(i / i_0)

The dead time of a switched amplifier distorts the voltage by the same law.

Not modelled: contact resistance that depends on speed and temperature.

Source: Kenjo and Nagamori, Permanent-Magnet and Brushless DC Motors, 1985, ch. 3.
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

U_B = Quantity(
    "u_b", "V", "voltage drop of both brushes, 0 = absent", start=0.5, minimum=0.0, strength=True
)
I_0 = Quantity("i_0", "A", "current over which the sign is smoothed", start=0.2, minimum=1e-6)

EFFECT = Effect(
    "brush_drop",
    "Voltage drop of the brushes.",
    ("winding",),
    U_B,
    source="Kenjo and Nagamori 1985",
)


def law(e: EffectModel) -> None:
    """Add the voltage drop."""
    p, i = e.parameters(U_B, I_0), e.signal("current")
    drop = p.u_b * ca.tanh(i / p.i_0)
    e.add(-drop)
    e.loss(drop * i)
