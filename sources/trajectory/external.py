"""Commands from outside, e.g. recorded ones, passed on; the heading is their integral.

    v_d = v_set,   w_d = w_set,   phi_d' = w_d,   xd_d = v_d cos(phi_d),   yd_d = v_d sin(phi_d)

Not modelled: anything that the command interface does (see `command_link`).

Source: digital twin paper (recorded speeds of the base as input of the twin).
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity
from ..model import Model
from . import HEADING, PHI_D, SOLVER, V_D, V_SET, W_D, W_SET, XD_D, YD_D

FIDELITY = Fidelity(level=2, solver=SOLVER)


def equations(m: Model) -> None:
    """Collect the equations."""
    v_d, w_d = m.input(V_SET), m.input(W_SET)
    v_d = v_d + m.balance("speed", "signal", unit="m/s", value=v_d).effort
    w_d = w_d + m.balance("yaw_rate", "signal", unit="rad/s", value=w_d).effort
    heading = m.state(HEADING)
    m.derivative(heading, w_d)
    m.output(V_D, v_d)
    m.output(W_D, w_d)
    m.output(XD_D, v_d * ca.cos(heading))
    m.output(YD_D, v_d * ca.sin(heading))
    m.output(PHI_D, heading)
