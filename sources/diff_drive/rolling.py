"""Two wheels that roll without slip.

    v = r (w_r + w_l)/2,   w_z = r (w_r - w_l)/track
    x' = v cos phi,   y' = v sin phi,   phi' = w_z

Not modelled: forces, slip (effects on `speed_left`, `speed_right`, `forward`, `turn`, `across`).

Source: e.g. Siciliano et al., Robotics, 2009, ch. 11.
"""

from __future__ import annotations

import casadi as ca

from .. import diff_drive as qs
from ..component import Fidelity, Solver
from ..model import Model

FIDELITY = Fidelity(level=0, solver=Solver("rk4", 0.02))


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.W_L, qs.W_R)
    p = m.parameters(qs.R, qs.TRACK)
    x = m.states(qs.POSE_X, qs.POSE_Y, qs.POSE_PHI)
    w_l = u.w_l + m.balance("speed_left", "signal", unit="rad/s", value=u.w_l).effort
    w_r = u.w_r + m.balance("speed_right", "signal", unit="rad/s", value=u.w_r).effort
    v, w_z = p.r * (w_r + w_l) / 2, p.r * (w_r - w_l) / p.track
    v += m.balance("forward", "signal", unit="m/s", value=v).effort
    w_z += m.balance("turn", "signal", unit="rad/s", value=w_z).effort
    across = m.balance("across", "across", value=0, along=v, turning=w_z).effort
    m.derivative(x.pose_x, v * ca.cos(x.pose_phi) - across * ca.sin(x.pose_phi))
    m.derivative(x.pose_y, v * ca.sin(x.pose_phi) + across * ca.cos(x.pose_phi))
    m.derivative(x.pose_phi, w_z)
    for quantity, value in (
        (qs.X, x.pose_x),
        (qs.Y, x.pose_y),
        (qs.PHI, x.pose_phi),
        (qs.V, v),
        (qs.W_Z, w_z),
    ):
        m.output(quantity, value)
