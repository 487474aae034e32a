"""Rolling resistance on top of what a wheel declares.

    tau = -c N r tanh(w/w_0),   P_loss = c N r w tanh(w/w_0)

Not modelled: dependence of c on speed and temperature, creep out of standstill (below w_0 the
moment falls).

Source: Johnson, Contact Mechanics, 1985, ch. 9 (hysteresis of the tread).
"""

from __future__ import annotations

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.contact import rolling_resistance
from ..quantity import Quantity

C = Quantity(
    "c",
    "1",
    "additional rolling resistance coefficient, 0 = absent",
    start=0.01,
    minimum=0.0,
    strength=True,
)
W_0 = Quantity("w_0", "rad/s", "wheel speed over which it changes sign", start=0.1, minimum=1e-6)

EFFECT = Effect(
    "rolling_resistance",
    "Rolling resistance of a loaded wheel.",
    ("rotation",),
    C,
    needs=("normal", "radius"),
    source="Johnson 1985",
)


def law(e: EffectModel) -> None:
    """Add the moment."""
    p, s = e.parameters(C, W_0), e.signals(N="normal", r="radius", w="velocity")
    moment = rolling_resistance(p.c, s.N, s.r, s.w, p.w_0)
    e.add(-moment)
    e.loss(moment * s.w)
