"""Driven wheel and its contact with a flat floor."""

from __future__ import annotations

from ..component import Component, Port
from ..quantity import Quantity

TAU = Quantity(
    "tau", "N.m", "torque of the drive on the axle, positive accelerates forward", start=5.0
)
J_ADDED = Quantity(
    "J_added", "kg.m2", "inertia that the wheel carries for its drive (a gearbox's `J_b`)"
)
V_X = Quantity(
    "v_x", "m/s", "velocity of the wheel centre, body x axis (forward)", start=0.5, nominal=1.0
)
V_Y = Quantity("v_y", "m/s", "velocity of the wheel centre, body y axis (left)", nominal=0.1)
V_Z = Quantity("v_z", "m/s", "velocity of the wheel centre, up", nominal=0.01)
W_Z = Quantity("w_z", "rad/s", "yaw rate of the body, positive turns left", nominal=1.0)
Z = Quantity("z", "m", "height of the wheel centre above the floor", start=0.1, nominal=0.1)
F_N = Quantity(
    "f_n",
    "N",
    "normal force, read by fidelities that do not compute it",
    start=200.0,
    nominal=200.0,
)
X_W = Quantity("x_w", "m", "world position of the contact")
Y_W = Quantity("y_w", "m", "world position of the contact")

F_X = Quantity("f_x", "N", "force of the floor on the wheel, body x axis")
F_Y = Quantity("f_y", "N", "force of the floor on the wheel, body y axis")
F_Z = Quantity("f_z", "N", "force of the floor on the wheel, up")
M_Z = Quantity("m_z", "N.m", "moment of the floor on the body about the vertical, positive left")
W = Quantity("w", "rad/s", "wheel speed, positive rolls forward")
PHI = Quantity("phi", "rad", "wheel angle, unwrapped")

ANGLE = Quantity("angle", "rad", "state: wheel angle")
SPEED = Quantity("speed", "rad/s", "state: wheel speed")

R = Quantity("r", "m", "rolling radius", start=0.1, minimum=1e-3, nominal=0.1)
J_W = Quantity("J_w", "kg.m2", "spin inertia of the wheel", start=0.01, minimum=1e-6, nominal=0.01)
C_RR = Quantity("c_rr", "1", "rolling resistance coefficient", minimum=0.0, nominal=0.01)
W_RR = Quantity(
    "w_rr",
    "rad/s",
    "wheel speed over which the rolling resistance changes sign",
    start=0.1,
    minimum=1e-6,
)
T_TURN = Quantity(
    "t_turn",
    "s",
    "time by which the direction of rolling lags that of the wheel while it turns",
    start=0.0,
    nominal=1e-3,
)

AXLE = Port("axle", TAU, W, "gives_motion", +1, "drive side of the axle")
HUB_X = Port("hub_x", F_X, V_X, "gives_effort", -1, "wheel centre, forward")
HUB_Y = Port("hub_y", F_Y, V_Y, "gives_effort", -1, "wheel centre, sideways")
HUB_Z = Port("hub_z", F_Z, V_Z, "gives_effort", -1, "wheel centre, vertical")
YAW = Port("yaw", M_Z, W_Z, "gives_effort", -1, "body, about the vertical")

COMPONENT = Component(
    "wheel_contact",
    "Driven wheel and its contact with a flat floor.",
    ports=(AXLE, HUB_X, HUB_Y, HUB_Z, YAW),
    device="mir250",
    source="digital twin paper, blocks DriveWheel and Contact (Spatial Contact Force)",
)
