"""Serial arm: joint torques and motion of the mount in, joint motion and wrench out.

Vectors of joints have as many elements as the device has joints; along a prismatic joint angles are
positions and torques are forces.
"""

from __future__ import annotations

from ..component import Component, Port
from ..quantity import INERTIA_UNITS, WRENCH_UNITS, Quantity

TAU = Quantity("tau", "N.m", "torques of the gears on the joints", size=2, nominal=50.0)
J_ADDED = Quantity(
    "J_added", "kg.m2", "inertias that the joints carry for their rotors (a drive's `J_b`)", size=2
)
MOUNT_POSITION = Quantity("mount_position", "m", "world position of the mount", size=3)
MOUNT_QUATERNION = Quantity(
    "mount_quaternion",
    "1",
    "attitude of the mount, quaternion w x y z, mount axes to world",
    start=(1.0, 0.0, 0.0, 0.0),
    size=4,
)
MOUNT_VELOCITY = Quantity("mount_velocity", "m/s", "velocity of the mount, mount axes", size=3)
MOUNT_RATE = Quantity("mount_rate", "rad/s", "angular velocity of the mount, mount axes", size=3)
MOUNT_ACCELERATION = Quantity(
    "mount_acceleration",
    "m/s2",
    "second derivative of the mount's position, less what a slope adds to gravity, mount axes",
    size=3,
)
MOUNT_ANGULAR_ACCELERATION = Quantity(
    "mount_angular_acceleration", "rad/s2", "angular acceleration of the mount, mount axes", size=3
)

Q = Quantity("q", "rad", "joint angles as the motor encoders see them, unwrapped", size=2)
QD = Quantity("qd", "rad/s", "joint speeds as the motor encoders see them", size=2)
TOOL_POSITION = Quantity("tool_position", "m", "world position of the tool flange", size=3)
TOOL_ROTATION = Quantity(
    "tool_rotation", "rad", "attitude of the tool flange in the world, rotation vector", size=3
)
WRENCH = Quantity(
    "wrench",
    "1",
    "force and moment of the mount on the arm at the mount, mount axes",
    size=6,
    units=WRENCH_UNITS,
)
MOUNT_FORCE = Quantity(
    "mount_force",
    "N",
    "force of the mount on the arm, mount axes (the wrench's first half)",
    size=3,
)
MOUNT_MOMENT = Quantity(
    "mount_moment", "N.m", "moment of the mount on the arm, mount axes (its second half)", size=3
)
ARM_INERTIA = Quantity(
    "arm_inertia",
    "1",
    "wrench per acceleration of the mount, 6x6, upper triangle row by row",
    size=21,
    units=INERTIA_UNITS,
)
ARM_BIAS = Quantity(
    "arm_bias",
    "1",
    "wrench for a mount that is not accelerated, force and moment, mount axes",
    size=6,
    units=WRENCH_UNITS,
)

ANGLE = Quantity(
    "angle",
    "rad",
    "state: joint angles",
    size=2,
)
SPEED = Quantity("speed", "rad/s", "state: joint speeds", size=2)
GRAVITY = Quantity("gravity", "m/s2", "gravity, along the world's -z axis", start=9.81)

JOINT = Port("joint", TAU, QD, "gives_motion", +1, "gear outputs of the joints")
MOUNT_TRANSLATION = Port(
    "mount_translation", MOUNT_FORCE, MOUNT_VELOCITY, "gives_effort", +1, "base flange"
)
MOUNT_ROTATION = Port("mount_rotation", MOUNT_MOMENT, MOUNT_RATE, "gives_effort", +1, "base flange")

COMPONENT = Component(
    "serial_arm",
    "Links of a serial arm on a mount.",
    ports=(JOINT, MOUNT_TRANSLATION, MOUNT_ROTATION),
    device="two_link",
    source="Featherstone, Rigid Body Dynamics Algorithms, 2008; Khalil, Dombre, Modeling, "
    "Identification and Control of Robots, 2002, ch. 9",
    like="ur5_arm",
)
