"""Rotating mass between two flanges: takes a torque on either side, gives its speed."""

from __future__ import annotations

from ..component import Component, Port
from ..quantity import Quantity

TAU_A = Quantity("tau_a", "N.m", "torque on flange a, positive accelerates", start=0.1, nominal=0.1)
TAU_B = Quantity("tau_b", "N.m", "torque on flange b, positive accelerates", nominal=0.1)
W = Quantity("w", "rad/s", "speed of the shaft")
PHI = Quantity("phi", "rad", "angle of the shaft, unwrapped")

J = Quantity("J", "kg.m2", "moment of inertia", start=2e-4, minimum=1e-9, nominal=1e-4)
B = Quantity("b", "N.m.s/rad", "viscous friction", minimum=0.0, nominal=1e-4)

ANGLE = Quantity("angle", "rad", "state: angle of the shaft", nominal=1.0)
SPEED = Quantity("speed", "rad/s", "state: speed of the shaft", nominal=10.0)

FLANGE_A = Port("flange_a", TAU_A, W, "gives_motion", +1, "the side of the drive")
FLANGE_B = Port("flange_b", TAU_B, W, "gives_motion", +1, "the side of the load")

COMPONENT = Component(
    "rotor",
    "Rotating mass between a drive and a load that gives torque.",
    ports=(FLANGE_A, FLANGE_B),
    source="textbook mechanics",
)
