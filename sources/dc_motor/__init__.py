"""DC motor with its servo amplifier: set speed and shaft speed in, torque out."""

from __future__ import annotations

from ..component import Component, Port
from ..quantity import Quantity

W_REF = Quantity("w_ref", "rad/s", "set speed of the motor", start=50.0, nominal=100.0)
W = Quantity("w", "rad/s", "speed of the shaft, given by what the motor drives", nominal=100.0)
TAU = Quantity("tau", "N.m", "torque on the driven side, positive accelerates it")
I = Quantity("i", "A", "winding current, positive drives forward")  # noqa: E741
U = Quantity("u", "V", "terminal voltage that the amplifier sets, mean over its PWM period")

I_SET = Quantity("i_set", "A", "set current that the speed loop asks for")
I_MEASURED = Quantity("i_measured", "A", "winding current as its sensor reports it to the loop")

K_T = Quantity(
    "K_t", "N.m/A", "torque constant and back-EMF constant", start=0.13, minimum=1e-6, nominal=0.1
)
R_A = Quantity("R_a", "ohm", "resistance of the winding", start=0.1, minimum=0.0, nominal=0.1)
L_A = Quantity("L_a", "H", "inductance of the winding", start=2e-4, minimum=1e-9, nominal=1e-4)
B_M = Quantity("b_m", "N.m.s/rad", "viscous friction of the motor", minimum=0.0, nominal=1e-4)
ACC_MAX = Quantity(
    "acc_max", "rad/s2", "acceleration limit on the set speed", start=50.0, minimum=1e-6
)
I_MAX = Quantity("i_max", "A", "current limit", start=40.0, minimum=1e-6)
U_MAX = Quantity("u_max", "V", "voltage limit, the supply's voltage", start=48.0, minimum=1e-6)

KP_V = Quantity("Kp_v", "A.s/rad", "speed loop, proportional gain", start=1.6, minimum=0.0)
KI_V = Quantity("Ki_v", "A/rad", "speed loop, integral gain", start=8.4, minimum=0.0)
KD_V = Quantity("Kd_v", "A.s2/rad", "speed loop, derivative gain", minimum=0.0)
T_FV = Quantity("T_fv", "s", "speed loop, filter time of the derivative", start=1e-3, minimum=1e-6)
KP_I = Quantity("Kp_i", "V/A", "current loop, proportional gain", start=0.19, minimum=0.0)
KI_I = Quantity("Ki_i", "V/(A.s)", "current loop, integral gain", start=94.0, minimum=0.0)
KD_I = Quantity("Kd_i", "V.s/A", "current loop, derivative gain", minimum=0.0)
T_FI = Quantity(
    "T_fi", "s", "current loop, filter time of the derivative", start=1e-4, minimum=1e-6
)
T_REF = Quantity(
    "T_ref",
    "s",
    "time constant with which the limited set speed reaches the commanded one",
    start=1e-3,
    minimum=1e-6,
)

CURRENT = Quantity("current", "A", "state of the winding", nominal=1.0)
SET_SPEED = Quantity("set_speed", "rad/s", "set speed behind the acceleration limit", nominal=100.0)
SPEED_INTEGRAL = Quantity("speed_integral", "A", "integral part of the speed loop")
SPEED_FILTER = Quantity("speed_filter", "rad/s", "filtered speed error, for the derivative")
CURRENT_INTEGRAL = Quantity("current_integral", "V", "integral part of the current loop")
CURRENT_FILTER = Quantity("current_filter", "A", "filtered current error, for the derivative")

SHAFT = Port("shaft", TAU, W, "gives_effort", -1, "shaft end; the rotor's inertia is outside")

COMPONENT = Component(
    "dc_motor",
    "DC motor with speed and current control.",
    ports=(SHAFT,),
    device="mir250",
    source="digital twin paper of the mobile manipulator, motor subsystem; Leonhard, Control of "
    "Electrical Drives, 2001, ch. 5 and 7",
)
