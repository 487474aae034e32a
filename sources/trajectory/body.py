"""Speeds commanded in body axes: along the path and about the vertical.

    v_d = s(t) + v_set,   w_d = kappa(t) s(t) + turn(t) + w_set
    phi_d' = w_d,   xd_d = v_d cos(phi_d),   yd_d = v_d sin(phi_d)

s, kappa and turn go from one segment to the next by ramps: s at the acceleration `a`, kappa over
`t_curve`, turn at `alpha`; with `smooth` = 1 a ramp r becomes 3 r^2 - 2 r^3 and its greatest
acceleration 1.5 times as large. A trapezoid of speed V and duration T (one segment, V / a < T)
covers V T.

Not modelled: limits of the robot.

Source: digital twin paper, trajectory block.
"""

from __future__ import annotations

import casadi as ca

from .. import trajectory as qs
from ..component import Fidelity
from ..model import Model
from . import SOLVER, profile

FIDELITY = Fidelity(level=0, solver=SOLVER)


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.V_SET, qs.W_SET)
    x = m.states(qs.HEADING)
    now = profile(m)
    v_d = now.speed + u.v_set
    v_d += m.balance("speed", "signal", unit="m/s", value=v_d).effort
    w_d = now.curvature * now.speed + now.turn + u.w_set
    w_d += m.balance("yaw_rate", "signal", unit="rad/s", value=w_d).effort
    m.derivative(x.heading, w_d)
    m.output(qs.V_D, v_d)
    m.output(qs.W_D, w_d)
    m.output(qs.XD_D, v_d * ca.cos(x.heading))
    m.output(qs.YD_D, v_d * ca.sin(x.heading))
    m.output(qs.PHI_D, x.heading)
