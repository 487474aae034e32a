"""Set motion of joints over time."""

from __future__ import annotations

import math

from ..component import Component
from ..quantity import Quantity

Q_SET = Quantity("q_set", "rad", "set angles of the joints", size=6)
QD_SET = Quantity("qd_set", "rad/s", "set speeds of the joints", size=6)
QDD_SET = Quantity("qdd_set", "rad/s2", "set accelerations of the joints", size=6)

Q_HOLD = Quantity(
    "q_hold",
    "rad",
    "angles about which the joints move",
    start=(math.pi / 2, -0.1, 0.2, -0.1 - math.pi / 2, -math.pi / 2, 0.0),
    size=6,
)
T_START = Quantity("t_start", "s", "time at which the motion begins", start=0.0)
RAMP = Quantity("ramp", "s", "time to fade in and out", start=1.0, minimum=1e-3)

COMPONENT = Component(
    "joint_trajectory",
    "Set motion of the joints of an arm.",
    source="digital twin paper of the mobile manipulator, joint trajectories of the UR5",
    energy=False,
)
