"""Two wheels that roll without slip.

    v = r (w_r + w_l)/2,   w_z = r (w_r - w_l)/track
    x' = v cos phi,   y' = v sin phi,   phi' = w_z

Not modelled: forces, slip (effects on `speed_left`, `speed_right`, `forward`, `turn`).

Source: e.g. Siciliano et al., Robotics, 2009, ch. 11.
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity, Solver
from ..model import Model
from . import PHI, POSE_PHI, POSE_X, POSE_Y, TRACK, W_L, W_R, W_Z, R, V, X, Y

FIDELITY = Fidelity(level=0, solver=Solver("rk4", 0.02))


def equations(m: Model) -> None:
    """Collect the equations."""
    w_l, w_r = m.input(W_L), m.input(W_R)
    w_l += m.balance("speed_left", "signal", unit="rad/s", value=w_l).effort
    w_r += m.balance("speed_right", "signal", unit="rad/s", value=w_r).effort
    r, track = m.parameter(R), m.parameter(TRACK)
    v, w_z = r * (w_r + w_l) / 2, r * (w_r - w_l) / track
    v += m.balance("forward", "signal", unit="m/s", value=v).effort
    w_z += m.balance("turn", "signal", unit="rad/s", value=w_z).effort
    x, y, phi = m.state(POSE_X), m.state(POSE_Y), m.state(POSE_PHI)
    m.derivative(x, v * ca.cos(phi))
    m.derivative(y, v * ca.sin(phi))
    m.derivative(phi, w_z)
    for quantity, value in ((X, x), (Y, y), (PHI, phi), (V, v), (W_Z, w_z)):
        m.output(quantity, value)
