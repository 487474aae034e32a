"""Perfect sensor in the world frame.

    x_meas = x,   y_meas = y,   z_meas = z,   phi_meas = phi

Not modelled: noise, frames, sampling.

Source: digital twin paper, World-MiR sensor.
"""

from __future__ import annotations

import casadi as ca

from .. import pose_sensor as qs
from ..component import Fidelity
from ..model import Model
from . import body_pose

FIDELITY = Fidelity(level=0)


def equations(m: Model) -> None:
    """Collect the equations."""
    pose, z = body_pose(m)
    m.output(qs.X_MEAS, pose[0])
    m.output(qs.Y_MEAS, pose[1])
    m.output(qs.Z_MEAS, z)
    m.output(qs.PHI_MEAS, pose[2])
    m.output(qs.VALID, ca.SX(1.0))
