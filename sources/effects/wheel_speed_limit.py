"""Limit of the speed of several wheels that keeps the differences between them.

    over  = max(0, max(w) - 1/s),   under = max(0, -1/s - min(w))
    w_i -> clip(w_i - keep (over - under), -1/s, 1/s)

With keep = 1 all wheels are slowed by what the fastest one exceeds the limit: a differential drive
keeps its yaw rate and loses forward speed. With keep = 0 each wheel is cut alone. The strength is
the slowness s = 1/limit, because a limit is absent when it is infinite.

Not modelled: dynamics of the limiter, limits that differ between the wheels.

Source: textbook (saturation with priority to the difference).
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.signal_effect import per_unit
from ..quantity import Quantity

SLOWNESS = Quantity(
    "slowness", "1", "1 / greatest speed, 0 = absent", start=1.0, minimum=0.0, strength=True
)
KEEP = Quantity(
    "keep",
    "1",
    "share of the excess that all wheels are slowed by; the rest is cut off",
    start=1.0,
    minimum=0.0,
    maximum=1.0,
)

EFFECT = Effect(
    "wheel_speed_limit",
    "Limit of the speed of several wheels that keeps their differences.",
    ("signal",),
    SLOWNESS,
    needs=("wheels",),
    unit="rad/s",
    source="textbook",
)


def law(e: EffectModel) -> None:
    """Replace the speeds by the limited ones."""
    p, w = e.parameters(s=per_unit(e, SLOWNESS), keep=KEEP), e.signal("wheels")
    active = p.s > 0
    limit = 1 / ca.if_else(active, p.s, 1.0)
    over = ca.fmax(0.0, ca.mmax(w) - limit)
    under = ca.fmax(0.0, -limit - ca.mmin(w))
    limited = ca.fmax(-limit, ca.fmin(limit, w - p.keep * (over - under)))
    e.add(ca.if_else(active, limited - w, 0.0))
