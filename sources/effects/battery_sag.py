"""Supply with an inner resistance: its voltage sags under load.

    i_b = u i / U_0,   f = -(u / U_0) r_b i_b,   P_loss = r_b i_b^2

i_b is the current out of the supply and u / U_0 the duty ratio of the amplifier, which does not
correct for the sag. It also lowers the largest voltage of the winding below the amplifier's limit.

Not modelled: other consumers of the same supply, state of charge.

Source: inner resistance behind a lossless chopper.
"""

from __future__ import annotations

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

R_B = Quantity(
    "r_b",
    "ohm",
    "inner resistance of the supply, 0 = absent",
    start=0.1,
    minimum=0.0,
    strength=True,
)
U_0 = Quantity("u_0", "V", "supply voltage without load", start=48.0, minimum=1e-3)

EFFECT = Effect(
    "battery_sag",
    "Supply voltage that falls with the current drawn.",
    ("winding",),
    R_B,
    needs=("voltage",),
    source="inner resistance behind a lossless chopper",
)


def law(e: EffectModel) -> None:
    """Add the missing voltage."""
    p, s = e.parameters(U_0=U_0, r_b=R_B), e.signals(i="current", u="voltage")
    duty = s.u / p.U_0
    i_b = duty * s.i
    sag = p.r_b * i_b
    e.add(-duty * sag)
    e.loss(sag * i_b)
