"""Base on two wheels that turn at given speeds."""

from __future__ import annotations

from ..component import Component
from ..quantity import Quantity

W_L = Quantity(
    "w_l", "rad/s", "speed of the left wheel, positive drives forward", start=3.0, nominal=3.0
)
W_R = Quantity(
    "w_r", "rad/s", "speed of the right wheel, positive drives forward", start=2.0, nominal=3.0
)
X = Quantity("x", "m", "world position of the middle of the axle")
Y = Quantity("y", "m", "world position of the middle of the axle")
PHI = Quantity("phi", "rad", "heading, unwrapped, positive turns left")
V = Quantity("v", "m/s", "forward speed")
W_Z = Quantity("w_z", "rad/s", "yaw rate, positive turns left")
POSE_X = Quantity("pose_x", "m", "state behind x")
POSE_Y = Quantity("pose_y", "m", "state behind y")
POSE_PHI = Quantity("pose_phi", "rad", "state behind phi")
R = Quantity("r", "m", "wheel radius", start=0.033, minimum=1e-3)
TRACK = Quantity("track", "m", "distance of the wheels", start=0.258, minimum=0.01)

COMPONENT = Component(
    "diff_drive",
    "Two-wheeled base on a floor, driven by the speeds of its wheels.",
    device="create",
    source="e.g. Siciliano et al., Robotics, 2009, ch. 11",
    energy=False,
)
