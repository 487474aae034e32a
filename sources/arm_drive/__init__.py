"""Position servos of an arm's joints: set motion and joint motion in, joint torques out.

Vectors have as many elements as the device has joints; along a prismatic joint angles are positions
and torques are forces.
"""

from __future__ import annotations

from ..component import Component, Port
from ..quantity import Quantity

Q_SET = Quantity("q_set", "rad", "set angles of the joints", size=2)
QD_SET = Quantity("qd_set", "rad/s", "set speeds of the joints", size=2)
Q = Quantity("q", "rad", "angles of the joints (gear outputs)", size=2)
QD = Quantity("qd", "rad/s", "speeds of the joints (gear outputs)", size=2)
TAU = Quantity("tau", "N.m", "torques of the gears on the joints", size=2)
TAU_MOTOR = Quantity("tau_motor", "N.m", "torques of the motors, behind the gears", size=2)
J_OUT = Quantity(
    "J_b", "kg.m2", "inertias that the joints carry for the rotors", size=2, passed_on=True
)

JOINT = Port("joint", TAU, QD, "gives_effort", -1, "gear outputs; the rotors' inertia is outside")

COMPONENT = Component(
    "arm_drive",
    "Position servos of the joints of an arm.",
    ports=(JOINT,),
    device="two_link",
    source="Siciliano et al., Robotics: Modelling, Planning and Control, 2009, ch. 8.5",
    like="ur5_drive",
)
