"""Commands are read at a fixed rate and held in between.

    v_d(t) = v_set(k T)   for   k T <= t < (k + 1) T,   and so on for the others

Not modelled: latency, jitter.

Source: rig sheet mobile_manipulator: commands at 100 Hz, held.
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity
from ..model import Model
from ..quantity import Quantity
from . import commands, deliver

FIDELITY = Fidelity(level=1)
T = Quantity("T", "s", "period of the commands", 0.01, minimum=1e-6, variability="fixed")
HELD = Quantity("held", "1", "command v_d, w_d, xd_d, yd_d, phi_d (SI) at the last tick", size=5)
STARTED = Quantity("started", "1", "1 once the first command is read")


def equations(m: Model) -> None:
    """Collect the equations."""
    now = commands(m)
    p = m.parameters(T)
    z = m.discretes(HELD, STARTED)
    clock = m.clock("command", p.T)
    m.update(clock, z.held, now)
    m.update(clock, z.started, ca.SX(1.0))
    deliver(m, ca.if_else(z.started > 0.5, z.held, now))
