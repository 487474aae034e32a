"""Zero of a sensor that wanders steadily.

    y = v + rate t,   t' = 1,   t = 0 at the start of a run

The heading that a gyro integrates, a load cell or an amplifier that warms up. A vector signal has a
`share` for each element, so that one joint or axis alone can be wrong.

Not modelled: a zero that wanders at random, or that settles (`first_order_lag` of what warms up).

Source: textbook; for gyros IEEE Std 528 (drift rate).
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.signal_effect import per_time, share
from ..quantity import Quantity

RATE = Quantity("rate", "1", "error gained per time, 0 = absent", start=0.01, strength=True)
T = Quantity("t", "s", "time since the start")

EFFECT = Effect(
    "zero_drift",
    "Error of a signal that grows steadily.",
    ("signal", "point"),
    RATE,
    source="textbook",
)


def law(e: EffectModel) -> None:
    """Add what has been gained."""
    rate, t = e.parameter(per_time(e, RATE)), e.state(T)
    e.derivative(t, ca.SX(1.0))
    e.add(rate * t * share(e))
