"""Differential-drive base on two drive wheels and four casters, with a mount for an arm."""

from __future__ import annotations

from ..component import Component, Port
from ..quantity import INERTIA_UNITS, WRENCH_UNITS, Quantity

TAU_L = Quantity("tau_l", "N.m", "torque on the left drive wheel, positive drives forward")
TAU_R = Quantity("tau_r", "N.m", "torque on the right drive wheel, positive drives forward")
J_L = Quantity("J_l", "kg.m2", "inertia that the left drive wheel carries for its drive")
J_R = Quantity("J_r", "kg.m2", "inertia that the right drive wheel carries for its drive")
ARM_INERTIA = Quantity(
    "arm_inertia",
    "1",
    "6x6 inertia of the arm at the mount (linear before angular), upper triangle row by row",
    size=21,
    units=INERTIA_UNITS,
)
ARM_BIAS = Quantity(
    "arm_bias",
    "1",
    "wrench that the mount applies to the arm at zero acceleration, body axes",
    size=6,
    units=WRENCH_UNITS,
)

X = Quantity("x", "m", "world position of the drive-axle centre O")
Y = Quantity("y", "m", "world position of the drive-axle centre O")
PHI = Quantity("phi", "rad", "heading of the body x axis, unwrapped, positive turns left")
Z = Quantity("z", "m", "height of O above the floor")
V = Quantity("v", "m/s", "velocity of O along the body x axis")
W_Z = Quantity("w_z", "rad/s", "yaw rate, positive turns left")
W_L = Quantity("w_l", "rad/s", "speed of the left drive wheel")
W_R = Quantity("w_r", "rad/s", "speed of the right drive wheel")
PHI_L = Quantity("phi_l", "rad", "angle of the left drive wheel, unwrapped")
PHI_R = Quantity("phi_r", "rad", "angle of the right drive wheel, unwrapped")
MOUNT_POSITION = Quantity("mount_position", "m", "position of the mount in the world", size=3)
MOUNT_QUATERNION = Quantity(
    "mount_quaternion", "1", "rotation from body to world axes, w x y z", size=4
)
MOUNT_VELOCITY = Quantity("mount_velocity", "m/s", "velocity of the mount, body axes", size=3)
MOUNT_RATE = Quantity("mount_rate", "rad/s", "angular velocity of the mount, body axes", size=3)
MOUNT_ACCELERATION = Quantity(
    "mount_acceleration",
    "m/s2",
    "second derivative of the mount's world position, less what a slope adds to gravity, body axes",
    size=3,
)
MOUNT_ANGULAR_ACCELERATION = Quantity(
    "mount_angular_acceleration", "rad/s2", "angular acceleration of the mount, body axes", size=3
)

POSE_X = Quantity("pose_x", "m", "state: world position of O")
POSE_Y = Quantity("pose_y", "m", "state: world position of O")
POSE_PHI = Quantity("pose_phi", "rad", "state: heading")

TRACK = Quantity(
    "track", "m", "distance of the drive-wheel contacts", start=0.41, minimum=1e-2, nominal=0.1
)
MOUNT_X = Quantity("mount_x", "m", "arm mount in front of O")
MOUNT_Y = Quantity("mount_y", "m", "arm mount to the left of O")
MOUNT_Z = Quantity("mount_z", "m", "height of the arm mount above the floor", start=0.7)

AXLE_L = Port("axle_l", TAU_L, W_L, "gives_motion", +1, "axle of the left drive wheel")
AXLE_R = Port("axle_r", TAU_R, W_R, "gives_motion", +1, "axle of the right drive wheel")

COMPONENT = Component(
    "mobile_base",
    "Differential-drive base with casters, a cabinet and an arm mount.",
    ports=(AXLE_L, AXLE_R),
    device="mir250",
    source="digital twin paper, MiR250 model",
)
