"""Scale error of a current sensor inside its loop.

    i_measured = (1 + g) i

Not modelled: nonlinearity, bandwidth and noise of the sensor.

Source: Bolton, Instrumentation and Control Systems, 2021, ch. 2 (gain error).
"""

from __future__ import annotations

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

G = Quantity("g", "1", "relative error of the scale, 0 = absent", start=0.02, strength=True)

EFFECT = Effect(
    "current_gain",
    "Scale error of a current sensor.",
    ("signal",),
    G,
    source="Bolton 2021",
    unit="A",
    general="gain",
)


def law(e: EffectModel) -> None:
    """Add the error."""
    g, i = e.parameter(G), e.signal("value")
    e.add(g * i)
