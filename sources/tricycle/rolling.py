"""Three wheels that roll without slip.

    delta = ratio steer,   v = r w cos delta,   w_z = r w sin delta/l
    x' = v cos phi,   y' = v sin phi,   phi' = w_z

Not modelled: forces, slip, play of the steering (effects on `steer` and `speed`).

Source: e.g. Siciliano et al., Robotics, 2009, ch. 11.
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity, Solver
from ..model import Model
from . import PHI, POSE_PHI, POSE_X, POSE_Y, RATIO, STEER, W_Z, L, R, V, W, X, Y

FIDELITY = Fidelity(level=0, solver=Solver("rk4", 0.02))


def equations(m: Model) -> None:
    """Collect the equations."""
    told, w = m.input(STEER), m.input(W)
    w += m.balance("speed", "signal", unit="rad/s", value=w).effort
    delta = m.parameter(RATIO) * told
    delta += m.balance("steer", "signal", unit="rad", value=delta).effort
    driven = m.parameter(R) * w
    v, w_z = driven * ca.cos(delta), driven * ca.sin(delta) / m.parameter(L)
    x, y, phi = m.state(POSE_X), m.state(POSE_Y), m.state(POSE_PHI)
    m.derivative(x, v * ca.cos(phi))
    m.derivative(y, v * ca.sin(phi))
    m.derivative(phi, w_z)
    for quantity, value in ((X, x), (Y, y), (PHI, phi), (V, v), (W_Z, w_z)):
        m.output(quantity, value)
