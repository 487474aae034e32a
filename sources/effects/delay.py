"""Transport delay: the signal arrives some time later.

    y(t) = v(t - t_d)

The past is sampled on a grid of `period`, or t_d / 62 where that is longer, and interpolated
linearly; at the grid points the delayed signal is exact. Before the start the signal is taken as
constant. A signal that is held over a communication step is delayed as it is held; one that is held
and read in multiples of `period` is delayed exactly if t_d is such a multiple, and else its steps
become ramps of a period.

Not modelled: jitter, lost or reordered messages.

Source: textbook; for the latency of a robot's command interface see the digital twin paper.
"""

from __future__ import annotations

import casadi as ca

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.history import NEVER, PERIOD, History
from ..quantity import Quantity

SAMPLES = 64
T_D = Quantity(
    "t_d",
    "s",
    "delay, 0 = absent",
    start=0.03,
    minimum=0.0,
    maximum=100.0,
    strength=True,
    hints=SearchHints(lattice=PERIOD.starts()[0]),
    variability="fixed",
)

EFFECT = Effect(
    "delay",
    "Transport delay of a signal.",
    ("signal", "bundle", "pose", "point"),
    T_D,
    source="textbook",
)


def law(e: EffectModel) -> None:
    """Replace the signal by its past."""
    p, v = e.parameters(T_D, PERIOD), e.signal("value")
    grid = ca.if_else(p.t_d > 0, ca.fmax(p.period, p.t_d / (SAMPLES - 2)), NEVER)
    past = History(e, "past", v, unit=e.unit, period=grid, slots=SAMPLES)
    e.add(ca.if_else(p.t_d > 0, past.at(p.t_d) - v, 0.0))
