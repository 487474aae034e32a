"""Sample and hold: the signal is read at a fixed rate and kept in between.

    y(t) = v(k t_s)   for   k t_s <= t < (k + 1) t_s

Not modelled: jitter of the sampling.

Source: textbook.
"""

from __future__ import annotations

import casadi as ca

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.history import NEVER
from ..laws.signal_effect import in_unit, sized
from ..quantity import Quantity

SHORTEST = 1e-5
"""Sample periods below 10 us act like this one: nothing here changes faster [s]."""
PERIODS = (5e-4, 1e-3, 2e-3, 2.5e-3, 4e-3, 5e-3, 8e-3, 0.01, 0.0125, 0.016, 0.02, 0.025, 0.03, 0.04,
           0.05, 0.1)  # fmt: skip
"""Periods that devices and buses have [s]. A period that is wrong by little samples at quite other
times after a second, so a fit does not find them."""
T_S = Quantity(
    "t_s",
    "s",
    "sample period, 0 = absent",
    start=0.01,
    minimum=0.0,
    strength=True,
    variability="fixed",
    hints=SearchHints(tries=PERIODS),
)
HELD = Quantity("held", "1", "value at the last sample")
STARTED = Quantity("started", "1", "1 once the first sample is taken")

EFFECT = Effect(
    "sample_hold",
    "Sample and hold of a signal.",
    ("signal", "bundle", "pose", "point"),
    T_S,
    source="textbook",
)


def law(e: EffectModel) -> None:
    """Replace the signal by its last sample."""
    t_s, v = e.parameter(T_S), e.signal("value")
    y, started = e.discrete(in_unit(e, sized(e, HELD))), e.discrete(STARTED)
    clock = e.clock("sample", ca.if_else(t_s > 0, ca.fmax(t_s, SHORTEST), NEVER))
    e.update(clock, y, v)
    e.update(clock, started, ca.SX(1.0))
    e.add(ca.if_else(t_s > 0, started * (y - v), 0.0))
