"""Limit of a signal's rate: an acceleration limit when the signal is a speed.

    y_k = y_{k-1} + max(-t_s / s, min(t_s / s, v - y_{k-1}))

The limiter works at the ticks of its sample period t_s, as in a digital controller. Its strength is
the slowness s, the time that one unit of the signal takes (1 / acceleration), because a limit is
absent when it is infinite.

Not modelled: limit of the jerk, different limits up and down.

Source: textbook.
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.history import NEVER
from ..laws.signal_effect import in_unit, per_unit, sized
from ..quantity import Quantity

SLOWNESS = Quantity(
    "slowness",
    "s",
    "time per unit of the signal, 1 / greatest rate, 0 = absent",
    start=2.0,
    minimum=0.0,
    strength=True,
    variability="fixed",
)
T_S = Quantity(
    "t_s", "s", "sample period of the limiter", start=1e-3, minimum=1e-9, variability="fixed"
)
LIMITED = Quantity("limited", "1", "limited signal")
STARTED = Quantity("started", "1", "1 once the limiter runs")

EFFECT = Effect("rate_limit", "Limit of a signal's rate.", ("signal",), SLOWNESS, source="textbook")


def law(e: EffectModel) -> None:
    """Replace the signal by the limited one."""
    p, v = e.parameters(s=per_unit(e, SLOWNESS), t_s=T_S), e.signal("value")
    y, started = e.discrete(in_unit(e, sized(e, LIMITED))), e.discrete(STARTED)
    clock = e.clock("limiter", ca.if_else(p.s > 0, p.t_s, NEVER))
    largest = p.t_s / ca.if_else(p.s > 0, p.s, 1.0)
    following = y + ca.fmax(-largest, ca.fmin(largest, v - y))
    e.update(clock, y, ca.if_else(started > 0.5, following, v))
    e.update(clock, started, ca.SX(1.0))
    e.add(ca.if_else(p.s > 0, started * (y - v), 0.0))
