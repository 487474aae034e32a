"""Three omni wheels whose slip along and across balances on the base.

Wheel i at arm (cos alpha_i, sin alpha_i) drives along t_i = (-sin alpha_i, cos alpha_i); its
rollers let it run along n_i = (cos alpha_i, sin alpha_i). With the velocity V = (v_x, v_y, w_z):

    slip along the wheel   s_i = T_i V - r w_i,   T_i = (t_i, arm)
    run across it          u_i = A_i V,           A_i = (n_i, 0)
    sum load_i (T_i^T s_i + rho_i A_i^T u_i) = 0

The forces of the floor are in proportion to load and creep; rho_i, the drag of the rollers over the
creep stiffness of the wheel, is 0 but for the effects on `roller`. With rho = 0 no wheel slips,
whatever the loads: T V = r w.

Not modelled: inertia, dry friction, bumps from roller to roller.

Source: kinematics e.g. Siciliano et al., Robotics, 2009, ch. 11; linear creep in its simplest form,
e.g. Kalker, Survey of wheel-rail rolling contact theory, 1979.
"""

from __future__ import annotations

import casadi as ca

from .. import omni_wheels as qs
from ..component import Fidelity, Solver
from ..laws import symmetric
from ..laws.planar_frame import rotated
from ..model import SX, Model

FIDELITY = Fidelity(level=0, solver=Solver("rk4", 0.02))


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.W)
    p = m.parameters(qs.R, qs.ARM, qs.ALPHA, qs.LOAD)
    x = m.states(qs.POSE_X, qs.POSE_Y, qs.POSE_PHI)
    w = u.w + m.balance("speeds", "signal", unit="rad/s", value=u.w).effort
    drag = m.balance("roller", "coefficient", unit="1", value=ca.DM.zeros(3), roller=p.load).effort
    cosine, sine = ca.cos(p.alpha), ca.sin(p.alpha)
    along = ca.horzcat(-sine, cosine, ca.repmat(p.arm, 3))
    across = ca.horzcat(cosine, sine, ca.DM.zeros(3))
    total: SX = ca.sum1(p.load)
    weight = p.load / (total / 3)
    matrix = along.T @ ca.diag(weight) @ along + across.T @ ca.diag(weight * drag) @ across
    v_x, v_y, w_z = ca.vertsplit(symmetric.solve(matrix, along.T @ (weight * p.r * w)))
    x_rate, y_rate = rotated(x.pose_phi, v_x, v_y)
    m.derivative(x.pose_x, x_rate)
    m.derivative(x.pose_y, y_rate)
    m.derivative(x.pose_phi, w_z)
    for quantity, value in (
        (qs.X, x.pose_x),
        (qs.Y, x.pose_y),
        (qs.PHI, x.pose_phi),
        (qs.V_X, v_x),
        (qs.V_Y, v_y),
        (qs.W_Z, w_z),
    ):
        m.output(quantity, value)
