"""Gain error of a signal.

    y = (1 + e) v

A vector signal has a `share` for each element, so that one joint or axis alone can be wrong.

Not modelled: nonlinearity.

Source: textbook.
"""

from __future__ import annotations

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.signal_effect import share
from ..quantity import Quantity

ERROR = Quantity(
    "error", "1", "relative error, 0 = absent", start=0.02, minimum=-1.0, strength=True
)

EFFECT = Effect("gain", "Gain error of a signal.", ("signal", "point"), ERROR, source="textbook")


def law(e: EffectModel) -> None:
    """Add a part of the signal."""
    p, v = e.parameters(e=ERROR), e.signal("value")
    e.add(p.e * share(e) * v)
