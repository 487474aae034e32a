"""Two virtual wheels that roll without slip, `e_right` and `e_left` outside the track centre lines.

    w_z = r (w2 - w3)/(B + e2 + e3)
    v   = r ((B/2 + e3) w2 + (B/2 + e2) w3)/(B + e2 + e3)
    x' = v cos beta + x_V w_z sin beta,  y' = v sin beta - x_V w_z cos beta,  beta' = w_z

With e2 = e3 = 0 this is plain differential drive. The virtual wheels stand where the instantaneous
centres of rotation of the tracks are, on the V-axis, `x_V` in front of the body frame origin.

Not modelled: forces (tau2 and tau3 are 0), the dependence of e2, e3 and x_V on speed, floor and
load, slip in straight driving, transients.

Source: crawler paper, Eq 18, 19 and 29 (sign corrected, see README).
"""

from __future__ import annotations

from .. import crawler as qs
from ..component import Fidelity, Solver
from ..model import Model
from ..quantity import Quantity
from .pose import integrate_pose, output_kinematic, pose_states, track_speeds, two_wheel_motion

FIDELITY = Fidelity(level=0, solver=Solver("rk4", 2e-3))

E_RIGHT = Quantity(
    "e_right",
    "m",
    "outward shift of the right virtual wheel, e2",
    start=0.0395,
    minimum=-0.04,
    nominal=0.01,
)
E_LEFT = Quantity(
    "e_left", "m", "outward shift of the left virtual wheel, e3", minimum=-0.04, nominal=0.01
)


def equations(m: Model) -> None:
    """Collect the equations."""
    speeds = track_speeds(m)
    p = m.parameters(qs.R, qs.B, qs.X_V, E_RIGHT, E_LEFT)
    e2, e3 = p.e_right, p.e_left
    v, w_z = two_wheel_motion(p.r, p.B, e2, e3, speeds)
    integrate_pose(m, pose_states(m), v, -p.x_V * w_z, w_z)
    output_kinematic(m, speeds, e2, e3)
