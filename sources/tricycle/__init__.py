"""Vehicle with one steered and driven wheel in front of a fixed axle."""

from __future__ import annotations

from ..component import Component
from ..quantity import Quantity

STEER = Quantity("steer", "rad", "angle of the steering's encoder, positive turns left", start=0.1)
W = Quantity(
    "w", "rad/s", "speed of the driven wheel, positive drives forward", start=3.0, nominal=3.0
)
X = Quantity("x", "m", "world position of the middle of the fixed axle")
Y = Quantity("y", "m", "world position of the middle of the fixed axle")
PHI = Quantity("phi", "rad", "heading, unwrapped, positive turns left")
V = Quantity("v", "m/s", "speed of the middle of the fixed axle")
W_Z = Quantity("w_z", "rad/s", "yaw rate, positive turns left")
POSE_X = Quantity("pose_x", "m", "state behind x")
POSE_Y = Quantity("pose_y", "m", "state behind y")
POSE_PHI = Quantity("pose_phi", "rad", "state behind phi")
R = Quantity("r", "m", "radius of the driven wheel", start=0.1, minimum=1e-4)
L = Quantity("l", "m", "distance of the driven wheel in front of the axle", start=1.4, minimum=0.01)
RATIO = Quantity("ratio", "1", "steering angle of the wheel over that of its encoder", start=1.0)

COMPONENT = Component(
    "tricycle",
    "Tricycle on a floor, driven by the angle of its front wheel and the speed of a driven one.",
    device="sapienza",
    source="e.g. Siciliano et al., Robotics, 2009, ch. 11",
    energy=False,
)
