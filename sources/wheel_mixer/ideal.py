"""Each wheel is told what the commanded motion asks of it, and does it.

    w_l = (v_set - track w_set/2)/r,   w_r = (v_set + track w_set/2)/r

Not modelled: dynamics and limits of the wheels' drives (effects on `command` and `wheels`).

Source: e.g. Siciliano et al., Robotics, 2009, ch. 11.
"""

from __future__ import annotations

import casadi as ca

from .. import wheel_mixer as qs
from ..component import Fidelity, Solver
from ..model import Model

FIDELITY = Fidelity(level=0, solver=Solver("rodas3_adaptive", 0.05, 1e-6))
"""Implicit, so that a short lag needs no short steps."""


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.V_SET, qs.W_SET)
    p = m.parameters(qs.R, qs.TRACK)
    command = ca.vertcat(u.v_set, u.w_set)
    command += m.balance("command", "bundle", value=command).effort
    v, w = ca.vertsplit(command)
    v += m.balance("forward", "signal", unit="m/s", value=v).effort
    w += m.balance("turn", "signal", unit="rad/s", value=w).effort
    speeds = ca.vertcat(v - p.track * w / 2, v + p.track * w / 2) / p.r
    speeds += m.balance("wheels", "signal", unit="rad/s", value=speeds, wheels=speeds).effort
    m.output(qs.W_L, speeds[0])
    m.output(qs.W_R, speeds[1])
