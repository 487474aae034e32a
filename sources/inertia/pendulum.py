"""Disc with an eccentric mass on a horizontal axis: the load of a servo bench.

    phi' = w,   (J + J_added) w' = tau - b w - m g l sin(phi - phi_0)

`phi = phi_0` hangs down. `J` is the whole inertia about the axis and includes m l^2.

Not modelled: inclined axis, elasticity of the arm.

Source: Newton's law for rotation.
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity, Solver
from ..model import SX, Model
from ..quantity import Quantity
from .load import rotation

FIDELITY = Fidelity(level=1, solver=Solver("rodas3", 1e-3))
MASS = Quantity("m", "kg", "eccentric mass", start=1.0, minimum=0.0)
DISTANCE = Quantity("l", "m", "distance of its centre from the axis", start=0.1, minimum=0.0)
GRAVITY = Quantity("g", "m/s2", "gravity across the axis", start=9.81, minimum=0.0)
HANGING = Quantity("phi_0", "rad", "angle at which the mass hangs: the zero of the angle's sensor")


def equations(m: Model) -> None:
    """Collect the equations."""
    p = m.parameters(MASS, GRAVITY, DISTANCE, HANGING)
    moment = p.m * p.g * p.l

    def gravity(angle: SX) -> tuple[SX, SX]:
        return -moment * ca.sin(angle - p.phi_0), moment * (1 - ca.cos(angle - p.phi_0))

    rotation(m, gravity)
