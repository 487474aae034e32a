"""Servo drive with a position loop: set angle, shaft angle and speed in, torque out."""

from __future__ import annotations

from ..component import Component, Port
from ..quantity import Quantity

Q_REF = Quantity("q_ref", "rad", "set angle of the shaft", start=0.5)
PHI = Quantity("phi", "rad", "angle of the shaft, given by what the drive moves")
W = Quantity("w", "rad/s", "speed of the shaft, given by what the drive moves", nominal=10.0)
TAU = Quantity("tau", "N.m", "torque on the driven side, positive accelerates it")
U = Quantity("u", "V", "output of the loops: set value or mean voltage of the amplifier")

T_LOOP = Quantity(
    "T_loop", "s", "period of the loops", start=1e-3, minimum=1e-6, variability="fixed"
)
U_HELD = Quantity("u_held", "V", "output of the loops, held until the next tick")

SHAFT = Port("shaft", TAU, W, "gives_effort", -1, "shaft; the rotor's inertia is outside")

COMPONENT = Component(
    "position_servo",
    "Servo drive that controls the angle of its shaft.",
    ports=(SHAFT,),
    device="ball_screw",
    source="Janot, Gautier, Brunot, Data set and reference models of EMPS, 2019; Duclusaud, "
    "Passault, Padois, Ly, Extended friction models for the physics simulation of servo "
    "actuators, ICRA 2025",
)
