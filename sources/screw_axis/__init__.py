"""Linear axis with a ball screw: torque on the screw in, its angle and the carriage's place out."""

from __future__ import annotations

from ..component import Component, Port
from ..quantity import Quantity

TAU = Quantity("tau", "N.m", "torque on the screw, positive accelerates it")
W = Quantity("w", "rad/s", "speed of the screw on the motor's side", nominal=100.0)
PHI = Quantity("phi", "rad", "angle of the screw on the motor's side, unwrapped", nominal=100.0)
X = Quantity("x", "m", "place of the carriage as the motor's encoder gives it")

LEAD = Quantity("lead", "m", "travel per turn of the screw", start=0.005, minimum=1e-6)
MASS = Quantity(
    "M", "kg", "moving mass, all that turns included as seen at the carriage", start=10.0,
    minimum=1e-6,
)  # fmt: skip
F_V = Quantity("F_v", "N.s/m", "viscous friction at the carriage", minimum=0.0, nominal=100.0)
F_C = Quantity("F_c", "N", "Coulomb friction at the carriage", minimum=0.0, nominal=10.0)
F_0 = Quantity("F_0", "N", "constant force on the carriage: offset, weight", nominal=10.0)
X_0 = Quantity(
    "x_0", "m", "place of the carriage where x is 0: the zero of the encoder against the screw"
)
V_0 = Quantity(
    "v_0", "m/s", "speed over which the sign of the friction is smoothed", start=2e-4, minimum=1e-9
)

ANGLE = Quantity("angle", "rad", "state: angle of the screw", nominal=100.0)
SPEED = Quantity("speed", "rad/s", "state: speed of the screw", nominal=100.0)

FLANGE = Port("flange", TAU, W, "gives_motion", +1, "motor's end of the screw")

COMPONENT = Component(
    "screw_axis",
    "Carriage on a ball screw.",
    ports=(FLANGE,),
    device="ball_screw",
    source="Janot, Gautier, Brunot, Data set and reference models of EMPS, 2019",
)
