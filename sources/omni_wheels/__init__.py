"""Base on three omni wheels that turn at given speeds."""

from __future__ import annotations

from ..component import Component
from ..quantity import Quantity

W = Quantity(
    "w", "rad/s", "speeds of the wheels, positive drives counter-clockwise", start=3.0, size=3
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
R = Quantity("r", "m", "wheel radius", start=0.04, minimum=1e-3)
ARM = Quantity("arm", "m", "distance of the wheels from the centre", start=0.125, minimum=1e-3)
ALPHA = Quantity(
    "alpha",
    "rad",
    "directions of the wheels from the centre",
    start=(1.0471975511965976, 3.141592653589793, 5.235987755982989),
    size=3,
)
LOAD = Quantity(
    "load", "N", "load on each wheel", start=(30.0, 30.0, 30.0), minimum=0.1, nominal=10.0, size=3
)

COMPONENT = Component(
    "omni_wheels",
    "Base on three omni wheels, driven by their speeds.",
    device="robotino",
    source="e.g. Siciliano et al., Robotics, 2009, ch. 11",
    energy=False,
)
