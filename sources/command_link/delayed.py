"""Commands arrive some time later.

    v_d(t) = v_set(t - t_d),   and so on for the others

The past is sampled every `period`, or t_d / 62 where that is longer, and interpolated linearly.
Before the start the commands are taken as constant.

Not modelled: jitter, lost or reordered messages.

Source: digital twin paper (network interface; its latency is not printed).
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity
from ..laws.history import History
from ..model import Model
from ..quantity import Quantity
from . import commands, deliver

FIDELITY = Fidelity(level=2)
SAMPLES = 64
T_D = Quantity("t_d", "s", "delay", 0.03, minimum=0.0, maximum=100.0, variability="fixed")
PERIOD = Quantity(
    "period",
    "s",
    "shortest distance of the samples of the past",
    1e-3,
    minimum=1e-6,
    variability="fixed",
)


def equations(m: Model) -> None:
    """Collect the equations."""
    p = m.parameters(T_D, PERIOD)
    grid = ca.fmax(p.period, p.t_d / (SAMPLES - 2))
    past = History(m, "command", commands(m), unit="1", period=grid, slots=SAMPLES)
    deliver(m, past.at(p.t_d))
