"""Constant error of a signal.

    y = v + b

A vector signal has a `share` for each element, so that one joint or axis alone can be wrong.

Not modelled: drift (`zero_drift`).

Source: textbook.
"""

from __future__ import annotations

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.signal_effect import in_unit, share
from ..quantity import Quantity

BIAS = Quantity("bias", "1", "constant error, 0 = absent", start=0.01, strength=True)

EFFECT = Effect("bias", "Constant error of a signal.", ("signal", "point"), BIAS, source="textbook")


def law(e: EffectModel) -> None:
    """Add the constant."""
    b = e.parameter(in_unit(e, BIAS))
    e.add(b * share(e))
