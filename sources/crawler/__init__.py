"""Small tracked vehicle whose two tracks are driven at given speeds."""

from __future__ import annotations

from ..component import Component, Port
from ..quantity import Quantity

W2 = Quantity(
    "w2", "rad/s", "speed of the right track wheel, positive drives forward", start=4.0, nominal=4.0
)
W3 = Quantity(
    "w3", "rad/s", "speed of the left track wheel, positive drives forward", start=3.0, nominal=4.0
)

X = Quantity("x", "m", "world position of the body frame origin O1")
Y = Quantity("y", "m", "world position of the body frame origin O1")
BETA = Quantity("beta", "rad", "heading of the body x axis, unwrapped, positive turns left")
V = Quantity("v", "m/s", "speed of O1 along the body x axis")
W_Z = Quantity("w_z", "rad/s", "yaw rate, positive turns left")
E2 = Quantity("e2", "m", "outward shift of the right virtual wheel from its track centre line")
E3 = Quantity("e3", "m", "outward shift of the left virtual wheel from its track centre line")
X_S = Quantity("x_S", "m", "world position of the body point S")
Y_S = Quantity("y_S", "m", "world position of the body point S")
TAU2 = Quantity("tau2", "N.m", "torque that the drive of the right track wheel has to deliver")
TAU3 = Quantity("tau3", "N.m", "torque that the drive of the left track wheel has to deliver")

POSE_X = Quantity("pose_x", "m", "world position of O1, the state behind x", nominal=1.0)
POSE_Y = Quantity("pose_y", "m", "world position of O1, the state behind y", nominal=1.0)
POSE_BETA = Quantity("pose_beta", "rad", "heading, the state behind beta")

R = Quantity(
    "r",
    "m",
    "effective radius of the track wheels",
    start=0.031,
    minimum=1e-3,
    nominal=0.05,
)
B = Quantity(
    "B", "m", "distance between the track centre lines", start=0.19, minimum=0.1, nominal=0.2
)
L_SX = Quantity("l_Sx", "m", "distance of point S behind O1", start=0.0775, nominal=0.1)
L_SY = Quantity("l_Sy", "m", "distance of point S to the right of O1", nominal=0.1)
X_V = Quantity(
    "x_V", "m", "distance of the V-axis (line of the rotation centres) in front of O1", nominal=0.01
)

SPROCKET_RIGHT = Port("sprocket_right", TAU2, W2, "gives_effort", +1, "right track wheel")
SPROCKET_LEFT = Port("sprocket_left", TAU3, W3, "gives_effort", +1, "left track wheel")

COMPONENT = Component(
    "crawler",
    "Small tracked vehicle on a floor, driven by the speeds of its two track wheels.",
    ports=(SPROCKET_RIGHT, SPROCKET_LEFT),
    device="paper",
    source="Majkut, Giergiel, Kohut, J. Mech. Sci. Technol. 31(2), 2017, 893-901",
)
