"""Six-joint arm: joint torques and motion of the mount in, joint motion and wrench out."""

from __future__ import annotations

from .. import serial_arm as general
from ..component import Component
from ..laws.joints import Joints

JOINTS = Joints((False,) * 6)
TAU, J_ADDED, ANGLE, SPEED = (
    JOINTS.sized(each) for each in (general.TAU, general.J_ADDED, general.ANGLE, general.SPEED)
)

COMPONENT = Component(
    "ur5_arm",
    "Links of a UR5 with revolute joints on a mount.",
    ports=(JOINTS.port(general.JOINT), general.MOUNT_TRANSLATION, general.MOUNT_ROTATION),
    device="ur5",
    source="digital twin paper of the mobile manipulator, UR5 block; Featherstone, Rigid Body "
    "Dynamics Algorithms, 2008",
)
