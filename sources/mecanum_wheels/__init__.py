"""Base on four Mecanum wheels that turn at given speeds."""

from __future__ import annotations

from ..component import Component
from ..quantity import Quantity

W = Quantity(
    "w",
    "rad/s",
    "speeds of the wheels front left, front right, rear left, rear right, positive drives forward",
    start=3.0,
    size=4,
)
X = Quantity("x", "m", "world position of the base's centre")
Y = Quantity("y", "m", "world position of the base's centre")
PHI = Quantity("phi", "rad", "heading, unwrapped, positive turns left")
V_X = Quantity("v_x", "m/s", "velocity along the base's x axis")
V_Y = Quantity("v_y", "m/s", "velocity along the base's y axis")
W_Z = Quantity("w_z", "rad/s", "yaw rate, positive turns left")
POSE_X = Quantity("pose_x", "m", "state behind x")
POSE_Y = Quantity("pose_y", "m", "state behind y")
POSE_PHI = Quantity("pose_phi", "rad", "state behind phi")
R = Quantity("r", "m", "wheel radius", start=0.07, minimum=1e-3)
LENGTH = Quantity(
    "length", "m", "wheels in front of and behind the centre", start=0.2, minimum=0.01
)
WIDTH = Quantity("width", "m", "wheels beside the centre", start=0.17, minimum=0.01)
GAMMA = Quantity(
    "gamma",
    "rad",
    "angle between the axes of rollers and wheel",
    start=0.7853981633974483,
    minimum=0.1,
    maximum=1.4,
)
LOAD = Quantity(
    "load",
    "N",
    "load on each wheel",
    start=(50.0, 50.0, 50.0, 50.0),
    minimum=0.1,
    nominal=10.0,
    size=4,
)

COMPONENT = Component(
    "mecanum_wheels",
    "Base on four Mecanum wheels, driven by their speeds.",
    device="polimi",
    source="e.g. Siciliano et al., Handbook of Robotics, 2016, ch. 24",
    energy=False,
)
