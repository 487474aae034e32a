"""Caster: a wheel that trails behind a swivel axis and carries part of a body's weight."""

from __future__ import annotations

from ..component import Component, Port
from ..quantity import Quantity

V_X = Quantity("v_x", "m/s", "velocity of the pivot, body x axis (forward)", start=0.3, nominal=1.0)
V_Y = Quantity("v_y", "m/s", "velocity of the pivot, body y axis (left)", nominal=0.1)
W_Z = Quantity("w_z", "rad/s", "yaw rate of the body, positive turns left", nominal=1.0)
F_N = Quantity("f_n", "N", "normal force on the wheel", start=200.0, nominal=200.0)
X_W = Quantity("x_w", "m", "world position of the pivot")
Y_W = Quantity("y_w", "m", "world position of the pivot")
TAU_F = Quantity(
    "tau_f",
    "N.m",
    "torque on the fork about the vertical, as a leaning swivel axis gives",
    nominal=0.01,
)

F_X = Quantity("f_x", "N", "force on the body at the pivot, body x axis, without `mass`, `relief`")
F_Y = Quantity("f_y", "N", "force on the body at the pivot, body y axis, without `mass`, `relief`")
F_Z = Quantity("f_z", "N", "force on the body at the pivot, up")
M_Z = Quantity("m_z", "N.m", "moment on the body about the vertical, positive left")
PSI = Quantity("psi", "rad", "swivel angle against the body, 0 when trailing in forward motion")
W = Quantity("w", "rad/s", "wheel speed, positive rolls forward along its heading")
W_F = Quantity("w_f", "rad/s", "yaw rate of the fork, positive turns left")
MASS = Quantity("mass", "kg", "mass that the body carries at the pivot")
RELIEF = Quantity(
    "relief",
    "kg",
    "xx, xy, yy of the mass that the body does not feel because the fork swings",
    size=3,
)

M_F = Quantity("m_f", "kg", "mass of the fork", start=0.31, minimum=0.0)
M_W = Quantity("m_w", "kg", "mass of the wheel", start=0.471, minimum=0.0)

PIVOT_X = Port("pivot_x", F_X, V_X, "gives_effort", -1, "pivot, forward")
PIVOT_Y = Port("pivot_y", F_Y, V_Y, "gives_effort", -1, "pivot, sideways")
YAW = Port("yaw", M_Z, W_Z, "gives_effort", -1, "body, about the vertical")
FORK = Port("fork", TAU_F, W_F, "gives_motion", +1, "fork, about the vertical")

COMPONENT = Component(
    "caster",
    "Caster that carries part of a body's weight.",
    ports=(PIVOT_X, PIVOT_Y, YAW, FORK),
    device="mir250",
    source="digital twin paper, block CasterWheel",
)
