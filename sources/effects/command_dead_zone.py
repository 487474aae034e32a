"""Dead zone: small commands do nothing, larger ones lose the width of the zone.

    y = v - max(-c, min(c, v))

Not modelled: a different width in either direction (combine with `bias`).

Source: textbook.
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.signal_effect import in_unit
from ..quantity import Quantity

WIDTH = Quantity(
    "width", "1", "half width of the zone, 0 = absent", start=0.02, minimum=0.0, strength=True
)

EFFECT = Effect(
    "command_dead_zone", "Dead zone of a command.", ("signal",), WIDTH, source="textbook"
)


def law(e: EffectModel) -> None:
    """Take away what falls into the zone."""
    c, v = e.parameter(in_unit(e, WIDTH)), e.signal("value")
    e.add(-ca.fmax(-c, ca.fmin(c, v)))
