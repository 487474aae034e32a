"""Three wheels that roll without slip.

    delta = ratio steer,   v = r w cos delta,   w_z = r w sin delta/l
    x' = v cos phi,   y' = v sin phi,   phi' = w_z

Not modelled: forces, slip, play of the steering (effects on `steer`, `speed` and `across`).

Source: e.g. Siciliano et al., Robotics, 2009, ch. 11.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from .. import tricycle as qs
from ..component import Fidelity, Solver
from ..model import SX, Model

FIDELITY = Fidelity(level=0, solver=Solver("rk4", 0.02))


class Wheel(NamedTuple):
    """Speed of the driven wheel over the floor, angle of the steered one, distance of the axles."""

    driven: SX
    delta: SX
    length: SX


def wheel(m: Model) -> Wheel:
    """Declare what all drives share, and let effects at speed and angle."""
    u = m.inputs(qs.STEER, qs.W)
    p = m.parameters(qs.RATIO, qs.R, qs.L)
    w = u.w + m.balance("speed", "signal", unit="rad/s", value=u.w).effort
    delta = p.ratio * u.steer
    delta += m.balance("steer", "signal", unit="rad", value=delta).effort
    return Wheel(p.r * w, delta, p.l)


def output_pose(m: Model, v: SX, w_z: SX) -> None:
    """Integrate the pose of the middle of the fixed axle and output it."""
    x = m.states(qs.POSE_X, qs.POSE_Y, qs.POSE_PHI)
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


def equations(m: Model) -> None:
    """Collect the equations."""
    front = wheel(m)
    v, w_z = front.driven * ca.cos(front.delta), front.driven * ca.sin(front.delta) / front.length
    output_pose(m, v, w_z)
