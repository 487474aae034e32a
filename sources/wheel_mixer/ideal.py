"""Each wheel is told what the commanded motion asks of it, and does it.

    w_l = (v_set - track w_set/2)/r,   w_r = (v_set + track w_set/2)/r

Not modelled: dynamics and limits of the wheels' drives (effects on `command` and `wheels`).

Source: e.g. Siciliano et al., Robotics, 2009, ch. 11.
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity, Solver
from ..model import Model
from . import TRACK, V_SET, W_L, W_R, W_SET, R

FIDELITY = Fidelity(level=0, solver=Solver("rodas3_adaptive", 0.05, 1e-6))
"""Implicit, so that a short lag needs no short steps."""


def equations(m: Model) -> None:
    """Collect the equations."""
    command = ca.vertcat(m.input(V_SET), m.input(W_SET))
    command += m.balance("command", "bundle", value=command).effort
    v, w = ca.vertsplit(command)
    v += m.balance("forward", "signal", unit="m/s", value=v).effort
    w += m.balance("turn", "signal", unit="rad/s", value=w).effort
    r, track = m.parameter(R), m.parameter(TRACK)
    speeds = ca.vertcat(v - track * w / 2, v + track * w / 2) / r
    speeds += m.balance("wheels", "signal", unit="rad/s", value=speeds, wheels=speeds).effort
    m.output(W_L, speeds[0])
    m.output(W_R, speeds[1])
