"""Encoder whose zero is off: the joint stands beside the angle that the controller believes.

    reading = theta + offset

Not modelled: eccentricity of the encoder's disc.

Source: textbook.
"""

from __future__ import annotations

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.signal_effect import share
from ..quantity import Quantity

OFFSET = Quantity(
    "offset", "rad", "error of the reading, 0 = absent", start=0.005, nominal=0.01, strength=True
)

EFFECT = Effect(
    "encoder_offset",
    "Encoder with a wrong zero.",
    ("signal",),
    OFFSET,
    source="textbook",
    unit="rad",
    general="bias",
)


def law(e: EffectModel) -> None:
    """Add the error."""
    offset = e.parameter(OFFSET)
    e.add(offset * share(e))
