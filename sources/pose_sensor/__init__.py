"""Sensor of the pose of a body that moves over a floor."""

from __future__ import annotations

from typing import Any

import casadi as ca

from ..component import Component
from ..model import Model
from ..quantity import Quantity

SX = Any

X = Quantity("x", "m", "position of the body in the world")
Y = Quantity("y", "m", "position of the body in the world")
Z = Quantity("z", "m", "height of the body above the floor")
PHI = Quantity("phi", "rad", "heading of the body in the world, unwrapped, positive to the left")
X_MEAS = Quantity("x_meas", "m", "measured position in the sensor's frame")
Y_MEAS = Quantity("y_meas", "m", "measured position in the sensor's frame")
Z_MEAS = Quantity("z_meas", "m", "measured height")
PHI_MEAS = Quantity("phi_meas", "rad", "measured heading in the sensor's frame, unwrapped")
VALID = Quantity("valid", "1", "1 while the body is seen, 0 while the last value is repeated")

COMPONENT = Component(
    "pose_sensor",
    "Sensor of the pose of a body that moves over a floor.",
    device="mir250",
    source="digital twin paper, World-MiR sensor and motion capture, Eq 2-5",
    energy=False,
)


def body_pose(m: Model) -> tuple[SX, SX]:
    """The inputs: planar pose (3) and height, with the balances on them."""
    u = m.inputs(X, Y, Z, PHI)
    pose = ca.vertcat(u.x, u.y, u.phi)
    pose += m.balance("pose", "pose", value=pose).effort
    pose[:2] += m.balance("position", "point", unit="m", value=pose[:2]).effort
    pose[2] += m.balance("yaw", "signal", unit="rad", value=pose[2], sensor=PHI_MEAS).effort
    z = u.z + m.balance("height", "signal", unit="m", value=u.z, sensor=Z_MEAS).effort
    return pose, z
