"""Rear wheels that drive and front wheels that steer, all rolling without slip: car, Ackermann.

    delta = ratio steer,   v = r w,   w_z = v tan(delta)/l
    x' = v cos phi,   y' = v sin phi,   phi' = w_z

`w` is the mean speed of the rear wheels (what the shaft into their differential turns at), `delta`
the angle of one wheel in the middle of the front axle, to which Ackermann's geometry turns the two
real ones; `l` is the distance of the axles.

Not modelled: forces, slip, play of the steering (effects on `steer`, `speed` and `across`).

Source: e.g. Siciliano et al., Robotics, 2009, ch. 11.
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity, Solver
from ..model import Model
from .rolling import output_pose, wheel

FIDELITY = Fidelity(level=1, solver=Solver("rk4", 0.02))


def equations(m: Model) -> None:
    """Collect the equations."""
    front = wheel(m)
    output_pose(m, front.driven, front.driven * ca.tan(front.delta) / front.length)
