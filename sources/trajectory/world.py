"""Speeds commanded in world axes together with a heading, the input of the paper's Eq 1.

    chi' = kappa(t) s(t) + turn(t) + w_set,   phi_d = chi - crab,   w_d = chi'
    xd_d = s cos(chi) + v_set cos(phi_d),   yd_d = s sin(chi) + v_set sin(phi_d)
    v_d = cos(phi_d) xd_d + sin(phi_d) yd_d

chi is the course, the direction of the path; `crab` is the angle by which the heading is commanded
to lag behind it. A base that cannot move sideways loses the part s sin(crab) of the command.

Not modelled: limits of the robot.

Source: digital twin paper, trajectory block and Eq 1.
"""

from __future__ import annotations

import casadi as ca

from .. import trajectory as qs
from ..component import Fidelity
from ..model import Model
from ..quantity import Quantity
from . import SOLVER, profile

FIDELITY = Fidelity(level=1, solver=SOLVER)
CRAB = Quantity("crab", "rad", "angle from the set heading to the course, positive to the left")


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.V_SET, qs.W_SET)
    now = profile(m)
    p = m.parameters(CRAB)
    x = m.states(qs.HEADING)
    s = now.speed
    s += m.balance("speed", "signal", unit="m/s", value=s).effort
    w_d = now.curvature * now.speed + now.turn + u.w_set
    w_d += m.balance("yaw_rate", "signal", unit="rad/s", value=w_d).effort
    phi_d = x.heading
    m.derivative(phi_d, w_d)
    chi = phi_d + p.crab
    xd_d = s * ca.cos(chi) + u.v_set * ca.cos(phi_d)
    yd_d = s * ca.sin(chi) + u.v_set * ca.sin(phi_d)
    m.output(qs.V_D, ca.cos(phi_d) * xd_d + ca.sin(phi_d) * yd_d)
    m.output(qs.W_D, w_d)
    m.output(qs.XD_D, xd_d)
    m.output(qs.YD_D, yd_d)
    m.output(qs.PHI_D, phi_d)
