"""Gearbox between a motor (flange_a, fast) and a load (flange_b, slow)."""

from __future__ import annotations

from ..component import Component, Port
from ..quantity import Quantity

TAU_A = Quantity("tau_a", "N.m", "torque of the motor on flange a", start=1.0, nominal=1.0)
W_A = Quantity("w_a", "rad/s", "speed of flange a")
TAU_B = Quantity("tau_b", "N.m", "torque on the load at flange b, positive accelerates it")
W_B = Quantity("w_b", "rad/s", "speed of flange b", start=1.0, nominal=10.0)
J_A = Quantity(
    "J_a", "kg.m2", "inertia of the rotor on flange a", start=2.0e-4, minimum=0.0, nominal=1e-4
)
J_B = Quantity(
    "J_b",
    "kg.m2",
    "inertia that the load carries for the rotor, as seen at flange b",
    passed_on=True,
)
RATIO = Quantity(
    "ratio", "1", "transmission ratio, w_a / w_b", start=10.167, minimum=1e-3, maximum=1e4
)
ETA = Quantity(
    "eta", "1", "efficiency, a factor on the motor's torque", start=0.9, minimum=0.1, maximum=1.0
)
B = Quantity("b", "N.m.s/rad", "viscous friction on flange b", minimum=0.0, nominal=0.1)
P_0 = Quantity(
    "P_0",
    "W",
    "power flow over which the efficiency changes from driving to braking",
    start=0.5,
    minimum=1e-6,
)

FLANGE_A = Port("flange_a", TAU_A, W_A, "gives_motion", +1, "motor side")
FLANGE_B = Port("flange_b", TAU_B, W_B, "gives_effort", -1, "load side")

COMPONENT = Component(
    "gearbox",
    "Reduction gearbox between a motor and its load.",
    ports=(FLANGE_A, FLANGE_B),
    device="mir250",
    source="digital twin paper of the mobile manipulator, gearbox block; Pelchen et al. 2002 "
    "(LossyGear) for the losses",
)
