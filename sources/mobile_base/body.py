"""Masses of the base: quantities that the dynamic fidelities share."""

from __future__ import annotations

from ..quantity import Quantity

MASS = Quantity(
    "mass", "kg", "body without wheels, cabinet and arm", start=70.0, minimum=0.1, nominal=10.0
)
COM_X = Quantity("com_x", "m", "mass centre of the body in front of O")
COM_Y = Quantity("com_y", "m", "mass centre of the body to the left of O")
I_ZZ = Quantity(
    "I_zz", "kg.m2", "yaw inertia of the body about its mass centre", start=5.0, minimum=1e-3
)
COM_Z = Quantity("com_z", "m", "height of the mass centre of the body", start=0.15)
I_XX = Quantity(
    "I_xx", "kg.m2", "roll inertia of the body about its mass centre", start=2.0, minimum=1e-3
)
I_YY = Quantity(
    "I_yy", "kg.m2", "pitch inertia of the body about its mass centre", start=4.0, minimum=1e-3
)
CABINET_MASS = Quantity("cabinet_mass", "kg", "cabinet, centred above O", start=15.0, minimum=0.0)
DRIVE_MASS = Quantity(
    "drive_mass", "kg", "one drive wheel with its motor and carrier", start=4.9, minimum=0.0
)
DRIVE_INERTIA = Quantity(
    "drive_inertia",
    "kg.m2",
    "inertia of one of them about the vertical through its centre, wheel not spinning",
    start=0.01,
    minimum=0.0,
)
CABINET_Z = Quantity("cabinet_z", "m", "height of the cabinet's mass centre", start=0.5)
CABINET_I_XX = Quantity(
    "cabinet_I_xx", "kg.m2", "roll inertia of the cabinet", start=0.4, minimum=0.0
)
CABINET_I_YY = Quantity(
    "cabinet_I_yy", "kg.m2", "pitch inertia of the cabinet", start=0.5, minimum=0.0
)
CABINET_I_ZZ = Quantity(
    "cabinet_I_zz", "kg.m2", "yaw inertia of the cabinet", start=0.5, minimum=0.0
)
CASTER_Z = Quantity(
    "caster_z", "m", "height of the mass centre of fork and wheel", start=0.08, minimum=0.0
)
GRAVITY = 9.81
"""[m/s2]"""

VEL_X = Quantity("vel_x", "m/s", "state: velocity of O along the body x axis")
VEL_Y = Quantity("vel_y", "m/s", "state: velocity of O along the body y axis")
VEL_Z = Quantity("vel_z", "m/s", "state: velocity of O along the body z axis")
ROLL_RATE = Quantity("roll_rate", "rad/s", "state: angular velocity about the body x axis")
PITCH_RATE = Quantity("pitch_rate", "rad/s", "state: angular velocity about the body y axis")
YAW_RATE = Quantity("yaw_rate", "rad/s", "state: angular velocity about the body z axis")
POSE_Z = Quantity("pose_z", "m", "state: height of O above the floor", start=0.0984)
ROLL = Quantity("roll", "rad", "state: roll angle, positive lowers the right side")
PITCH = Quantity("pitch", "rad", "state: pitch angle, positive lowers the front")
V_Y = Quantity("v_y", "m/s", "velocity of O along the body y axis")
LOADS = Quantity(
    "loads",
    "N",
    "wheel loads left, right, front left, front right, rear left, rear right",
    size=6,
)
