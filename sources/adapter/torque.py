"""Torque on a shaft, with the motion of what it acts on.

    y = u,   angle' = w

The balance `inside` takes effects on the shaft: they add to the torque what they would give if
they acted where the FMU behind it gives or takes it. The angle is counted from the start.

Not modelled: anything, unless an effect is added.

Source: definition.
"""

from __future__ import annotations

from ..component import Fidelity, Solver
from ..model import Model
from ..quantity import Quantity
from . import push

FIDELITY = Fidelity(level=1, solver=Solver("rk4", 1e-2))
GIVEN = Quantity("u", "N.m", "torque as it is given", start=1.0)
TAKEN = Quantity("y", "N.m", "torque as it is taken")
W = Quantity("w", "rad/s", "speed of the shaft")
ANGLE = Quantity("angle", "rad", "state: angle of the shaft since the start")


def equations(m: Model) -> None:
    """Collect the equations."""
    push(m, GIVEN, TAKEN, "rotation", (W, ANGLE))
