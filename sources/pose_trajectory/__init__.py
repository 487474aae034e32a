"""Set motion of a platform that can move in all directions of the plane."""

from __future__ import annotations

import casadi as ca

from ..component import Component
from ..model import SX, Model
from ..quantity import Quantity

X_SET = Quantity("x_set", "m", "set position in the world")
Y_SET = Quantity("y_set", "m", "set position in the world")
THETA_SET = Quantity("theta_set", "rad", "set heading, unwrapped, positive turns left")
XD_SET = Quantity("xd_set", "m/s", "set velocity along the world's x axis")
YD_SET = Quantity("yd_set", "m/s", "set velocity along the world's y axis")
THETAD_SET = Quantity("thetad_set", "rad/s", "set yaw rate, positive turns left")
XDD_SET = Quantity("xdd_set", "m/s2", "set acceleration along the world's x axis")
YDD_SET = Quantity("ydd_set", "m/s2", "set acceleration along the world's y axis")
THETADD_SET = Quantity("thetadd_set", "rad/s2", "set yaw acceleration")
SET_MOTION = (
    (X_SET, Y_SET, THETA_SET),
    (XD_SET, YD_SET, THETAD_SET),
    (XDD_SET, YDD_SET, THETADD_SET),
)
"""Pose, its first and its second derivative; a drive declares them as inputs."""

T_START = Quantity("t_start", "s", "time at which the motion begins", start=1.0)
X_0 = Quantity("x_0", "m", "position before the motion")
Y_0 = Quantity("y_0", "m", "position before the motion")
THETA_0 = Quantity("theta_0", "rad", "heading before the motion")

COMPONENT = Component(
    "pose_trajectory",
    "Set motion of a platform that can move in all directions of the plane.",
    source="omnidirectional base paper, desired motion of the platform in its simulator",
    energy=False,
)


def output_motion(m: Model, pose: SX) -> None:
    """Output the pose (3) and its derivatives in time."""
    rate = ca.jacobian(pose, m.t)
    for quantities, values in zip(SET_MOTION, (pose, rate, ca.jacobian(rate, m.t)), strict=True):
        for i, quantity in enumerate(quantities):
            m.output(quantity, values[i])


def start_pose(m: Model) -> SX:
    """The pose before the motion."""
    p = m.parameters(X_0, Y_0, THETA_0)
    return ca.vertcat(p.x_0, p.y_0, p.theta_0)
