"""Constant error of a current sensor inside its loop.

    i_measured = i + i_off

Not modelled: drift of the offset.

Source: Bolton, Instrumentation and Control Systems, 2021, ch. 2 (zero error).
"""

from __future__ import annotations

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

I_OFF = Quantity("i_off", "A", "offset of the sensor, 0 = absent", start=0.2, strength=True)

EFFECT = Effect(
    "current_offset",
    "Offset of a current sensor.",
    ("signal",),
    I_OFF,
    source="Bolton 2021",
    unit="A",
    general="bias",
)


def law(e: EffectModel) -> None:
    """Add the error."""
    e.add(e.parameter(I_OFF))
