"""Rotating load on a shaft: takes torque, gives speed and angle."""

from __future__ import annotations

from ..component import Component, Port
from ..quantity import Quantity

TAU = Quantity("tau", "N.m", "torque on the load, positive accelerates it", start=1.0, nominal=1.0)
J_ADDED = Quantity(
    "J_added", "kg.m2", "inertia that the load carries for its drive (a gearbox's `J_b`)"
)
W = Quantity("w", "rad/s", "speed of the load")
PHI = Quantity("phi", "rad", "angle of the load, unwrapped")

J = Quantity("J", "kg.m2", "moment of inertia", start=0.1, minimum=1e-9, nominal=0.1)
B = Quantity("b", "N.m.s/rad", "viscous friction", minimum=0.0, nominal=0.1)

ANGLE = Quantity("angle", "rad", "state: angle of the load", nominal=1.0)
SPEED = Quantity("speed", "rad/s", "state: speed of the load", nominal=10.0)

FLANGE = Port("flange", TAU, W, "gives_motion", +1, "the shaft")

COMPONENT = Component(
    "inertia",
    "Rotating load on a shaft.",
    ports=(FLANGE,),
    device="lab_bench",
    source="textbook mechanics",
)
