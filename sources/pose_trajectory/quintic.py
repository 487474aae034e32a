"""Move from one pose to another with smooth acceleration.

    xi = xi_0 + (dx, dy, dtheta) (10 s^3 - 15 s^4 + 6 s^5),   s = (t - t_start)/duration in 0..1

Straight in the world while the heading turns in step.

Not modelled: limits of speed or torque.

Source: Siciliano et al., Robotics: Modelling, Planning and Control, 2009, ch. 4.
"""

from __future__ import annotations

import casadi as ca

from .. import pose_trajectory as qs
from ..component import Fidelity
from ..joint_trajectory.path import smooth
from ..model import Model
from ..quantity import Quantity
from . import output_motion, start_pose

FIDELITY = Fidelity(level=0)
DX = Quantity("dx", "m", "move along the world's x axis", start=1.5)
DY = Quantity("dy", "m", "move along the world's y axis", start=0.5)
DTHETA = Quantity("dtheta", "rad", "turn, positive to the left", start=1.0)
DURATION = Quantity("duration", "s", "time that the move takes", start=5.0, minimum=1e-3)


def equations(m: Model) -> None:
    """Collect the equations."""
    start = start_pose(m)
    p = m.parameters(DX, DY, DTHETA, qs.T_START, DURATION)
    move = ca.vertcat(p.dx, p.dy, p.dtheta)
    s = (m.t - p.t_start) / p.duration
    output_motion(m, start + move * smooth(s))
