"""Four Mecanum wheels whose slip along and across their rollers balances on the base.

Wheel i at p_i = (+-length, +-width) turns at w_i; its contact moves at v_i = v + w_z x p_i. The
roller on the floor has its axis along g_i and rolls along h_i:

    g_i = (cos gamma, -+sin gamma)   (front left and rear right: -, front right and rear left: +)
    slip along the axis     s_i = g_i . (v_i - r w_i e_x)
    run across the axis     u_i = h_i . (v_i - r w_i e_x)
    sum load_i J_i^T (g_i s_i + rho_i h_i u_i) = 0

The forces of the floor are in proportion to load and creep; rho_i, the drag of the rollers over the
creep stiffness along their axis, is 0 but for the effects on `roller`. With rho = 0 the motion is
the least squares solution of g_i . v_i = r w_i cos gamma, weighted with the loads: four wheels for
three velocities.

Not modelled: inertia, dry friction, bumps from roller to roller.

Source: kinematics e.g. Siciliano et al., Handbook of Robotics, 2016, ch. 24; linear creep as in
`omni_wheels/rolling`.
"""

from __future__ import annotations

import casadi as ca

from .. import mecanum_wheels as qs
from ..component import Fidelity, Solver
from ..laws import symmetric
from ..laws.planar_frame import rotated
from ..model import SX, Model

FIDELITY = Fidelity(level=0, solver=Solver("rk4", 0.02))
FRONT = ca.DM([1, 1, -1, -1])
LEFT = ca.DM([1, -1, 1, -1])


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.W)
    p = m.parameters(qs.R, qs.GAMMA, qs.LOAD, qs.LENGTH, qs.WIDTH)
    x = m.states(qs.POSE_X, qs.POSE_Y, qs.POSE_PHI)
    w = u.w + m.balance("speeds", "signal", unit="rad/s", value=u.w).effort
    p_x, p_y = FRONT * p.length, LEFT * p.width
    drag = m.balance("roller", "coefficient", unit="1", value=ca.DM.zeros(4), roller=p.load).effort
    cosine, sine = ca.repmat(ca.cos(p.gamma), 4), -FRONT * LEFT * ca.sin(p.gamma)

    def rows(x: SX, y: SX) -> SX:
        """(x, y) . v_i as rows on (v_x, v_y, w_z)."""
        return ca.horzcat(x, y, p_x * y - p_y * x)

    along, across = rows(cosine, sine), rows(-sine, cosine)
    total: SX = ca.sum1(p.load)
    weight = p.load / (total / 4)
    matrix = along.T @ ca.diag(weight) @ along + across.T @ ca.diag(weight * drag) @ across
    right = along.T @ (weight * cosine * p.r * w) - across.T @ (weight * drag * sine * p.r * w)
    v_x, v_y, w_z = ca.vertsplit(symmetric.solve(matrix, right))
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
