"""Torque constant that falls with current: saturation of the iron.

    k = K (1 - s i^2 / (i^2 + i_s^2))

Torque and back-EMF use the same k, so their powers stay equal.

Not modelled: inductance that falls with current, field of the armature.

Source: Hanselman, Brushless Permanent Magnet Motor Design, 2006, ch. 4.
"""

from __future__ import annotations

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

S = Quantity(
    "s",
    "1",
    "share of the constant lost at high current, 0 = absent",
    start=0.1,
    maximum=1.0,
    strength=True,
)
I_S = Quantity("i_s", "A", "current at which half of that is lost", start=20.0, minimum=1e-3)

EFFECT = Effect(
    "torque_constant_saturation",
    "Torque constant that falls with current.",
    ("coefficient",),
    S,
    needs=("current",),
    source="Hanselman 2006",
    unit="N.m/A",
)


def law(e: EffectModel) -> None:
    """Add what the constant loses."""
    p, i, K = e.parameters(I_S, S), e.signal("current"), e.signal("value")
    square = i**2
    e.add(-p.s * K * (square / (square + p.i_s**2)))
