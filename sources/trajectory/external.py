"""Commands from outside, e.g. recorded ones, passed on; the heading is their integral.

    v_d = v_set,   w_d = w_set,   phi_d' = w_d,   xd_d = v_d cos(phi_d),   yd_d = v_d sin(phi_d)

Not modelled: anything that the command interface does (see `command_link`).

Source: digital twin paper (recorded speeds of the base as input of the twin).
"""

from __future__ import annotations

import casadi as ca

from .. import trajectory as qs
from ..component import Fidelity
from ..model import Model
from . import SOLVER

FIDELITY = Fidelity(level=2, solver=SOLVER)


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.V_SET, qs.W_SET)
    x = m.states(qs.HEADING)
    v_d = u.v_set + m.balance("speed", "signal", unit="m/s", value=u.v_set).effort
    w_d = u.w_set + m.balance("yaw_rate", "signal", unit="rad/s", value=u.w_set).effort
    m.derivative(x.heading, w_d)
    m.output(qs.V_D, v_d)
    m.output(qs.W_D, w_d)
    m.output(qs.XD_D, v_d * ca.cos(x.heading))
    m.output(qs.YD_D, v_d * ca.sin(x.heading))
    m.output(qs.PHI_D, x.heading)
