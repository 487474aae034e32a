"""Perfect sensor in the world frame.

    x_meas = x,   y_meas = y,   z_meas = z,   phi_meas = phi

Not modelled: noise, frames, sampling.

Source: digital twin paper, World-MiR sensor.
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity
from ..model import Model
from . import PHI_MEAS, VALID, X_MEAS, Y_MEAS, Z_MEAS, body_pose

FIDELITY = Fidelity(level=0)


def equations(m: Model) -> None:
    """Collect the equations."""
    pose, z = body_pose(m)
    m.output(X_MEAS, pose[0])
    m.output(Y_MEAS, pose[1])
    m.output(Z_MEAS, z)
    m.output(PHI_MEAS, pose[2])
    m.output(VALID, ca.SX(1.0))
