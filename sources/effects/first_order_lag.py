"""First-order lag of a signal.

    t_lag y' = v - y

It starts settled: the state is y less the signal's value at the start of the run. Where t_lag is
shorter than two steps of a fixed step, the FMU controls its error.

Not modelled: higher order.

Source: textbook.
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.history import ONCE
from ..laws.signal_effect import in_unit, sized
from ..quantity import Quantity

T_LAG = Quantity(
    "t_lag",
    "s",
    "time constant, 0 = absent",
    start=0.02,
    minimum=0.0,
    strength=True,
    variability="fixed",
)
CHANGE = Quantity("change", "1", "lagged change of the signal since the start")
ORIGIN = Quantity("origin", "1", "value of the signal at the start")
STARTED = Quantity("started", "1", "1 once the start value is taken")

EFFECT = Effect(
    "first_order_lag",
    "First-order lag of a signal.",
    ("signal", "bundle", "pose", "point"),
    T_LAG,
    source="textbook",
    stiff=True,
)


def law(e: EffectModel) -> None:
    """Replace the signal by its lagged copy."""
    t_lag, v = e.parameter(T_LAG), e.signal("value")
    change = e.state(in_unit(e, sized(e, CHANGE)))
    origin = e.discrete(in_unit(e, sized(e, ORIGIN)))
    started = e.discrete(STARTED)
    clock = e.clock("start", ONCE)
    e.update(clock, origin, ca.if_else(started > 0.5, origin, v))
    e.update(clock, started, ca.SX(1.0))
    y_dot = started * (v - origin - change) / ca.if_else(t_lag > 0, t_lag, 1.0)
    e.derivative(change, ca.if_else(t_lag > 0, y_dot, 0.0))
    e.add(ca.if_else(t_lag > 0, started * (origin + change - v), 0.0))
