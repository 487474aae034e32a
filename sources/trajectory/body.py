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

from ..component import Fidelity
from ..model import Model
from . import HEADING, PHI_D, SOLVER, V_D, V_SET, W_D, W_SET, XD_D, YD_D, profile

FIDELITY = Fidelity(level=0, solver=SOLVER)


def equations(m: Model) -> None:
    """Collect the equations."""
    v_set, w_set = m.input(V_SET), m.input(W_SET)
    now = profile(m)
    v_d = now.speed + v_set
    v_d += m.balance("speed", "signal", unit="m/s", value=v_d).effort
    w_d = now.curvature * now.speed + now.turn + w_set
    w_d += m.balance("yaw_rate", "signal", unit="rad/s", value=w_d).effort
    heading = m.state(HEADING)
    m.derivative(heading, w_d)
    m.output(V_D, v_d)
    m.output(W_D, w_d)
    m.output(XD_D, v_d * ca.cos(heading))
    m.output(YD_D, v_d * ca.sin(heading))
    m.output(PHI_D, heading)
