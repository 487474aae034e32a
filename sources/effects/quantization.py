"""Finite resolution of a signal: rounding to the nearest step.

    y = q floor(v / q + 1/2)

Not modelled: missing codes, limits of the range.

Source: textbook.
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.signal_effect import in_unit
from ..quantity import Quantity

STEP = Quantity("step", "1", "resolution, 0 = absent", start=0.01, minimum=0.0, strength=True)

EFFECT = Effect(
    "quantization", "Finite resolution of a signal.", ("signal", "point"), STEP, source="textbook"
)


def law(e: EffectModel) -> None:
    """Add the rounding."""
    q, v = e.parameter(in_unit(e, STEP)), e.signal("value")
    divisor = ca.if_else(q > 0, q, 1.0)
    e.add(ca.if_else(q > 0, q * ca.floor(v / divisor + 0.5) - v, 0.0))
