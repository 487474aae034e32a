"""Wheel speeds of a differential drive for a commanded motion."""

from __future__ import annotations

from ..component import Component
from ..quantity import Quantity

V_SET = Quantity("v_set", "m/s", "forward speed as commanded", start=0.3)
W_SET = Quantity("w_set", "rad/s", "yaw rate as commanded, positive turns left")
W_L = Quantity("w_l", "rad/s", "speed of the left wheel, positive drives forward", nominal=3.0)
W_R = Quantity("w_r", "rad/s", "speed of the right wheel, positive drives forward", nominal=3.0)
R = Quantity("r", "m", "wheel radius that the controller believes", start=0.033, minimum=1e-3)
TRACK = Quantity(
    "track", "m", "distance of the wheels that the controller believes", start=0.258, minimum=0.01
)

COMPONENT = Component(
    "wheel_mixer",
    "Controller of a differential drive: forward speed and yaw rate in, speeds of the wheels out.",
    device="create",
    source="e.g. Siciliano et al., Robotics, 2009, ch. 11",
    energy=False,
)
