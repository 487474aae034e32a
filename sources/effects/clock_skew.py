"""A clock that runs slow: what is stamped t was there earlier, and ever more so.

    y(t) = v(t - s t)

For a recorder whose clock drifts against that of the robot. A clock that runs fast would need the
future; let the other side's clock run slow instead. The past is kept for s times `horizon`; later
the delay no longer grows.

Not modelled: jitter; a constant offset of the clocks is the effect `delay`.

Source: textbook.
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.history import NEVER, PERIOD, History
from ..quantity import Quantity

SAMPLES = 64
SKEW = Quantity(
    "skew",
    "1",
    "time lost per time, 0 = absent",
    start=1e-4,
    minimum=0.0,
    maximum=0.1,
    strength=True,
    variability="fixed",
)
HORIZON = Quantity(
    "horizon",
    "s",
    "duration over which the lost time is kept",
    start=120.0,
    minimum=0.0,
    variability="fixed",
)

EFFECT = Effect(
    "clock_skew",
    "Drifting time stamps of a signal.",
    ("signal", "bundle", "pose", "point"),
    SKEW,
    source="textbook",
)


def law(e: EffectModel) -> None:
    """Replace the signal by an ever older value."""
    p, v = e.parameters(s=SKEW, horizon=HORIZON, period=PERIOD), e.signal("value")
    grid = ca.if_else(p.s > 0, ca.fmax(p.period, p.s * p.horizon / (SAMPLES - 2)), NEVER)
    past = History(e, "past", v, unit=e.unit, period=grid, slots=SAMPLES)
    lost = p.s * ca.fmin(ca.fmax(e.t, 0.0), p.horizon)
    e.add(ca.if_else(p.s > 0, past.at(lost) - v, 0.0))
