"""Servo drives of the six joints of a UR5: set angles and joint motion in, joint torques out."""

from __future__ import annotations

from ..component import Component, Port
from ..quantity import Quantity

Q_SET = Quantity("q_set", "rad", "set angles of the joints", size=6)
QD_SET = Quantity("qd_set", "rad/s", "set speeds of the joints", size=6)
Q = Quantity("q", "rad", "angles of the joints (gear outputs)", size=6)
QD = Quantity("qd", "rad/s", "speeds of the joints (gear outputs)", size=6)
TAU = Quantity("tau", "N.m", "torques of the gears on the joints", size=6)
I = Quantity("i", "A", "winding currents, positive turns the joint forward", size=6)  # noqa: E741
U = Quantity("u", "V", "terminal voltages", size=6)
J_B = Quantity(
    "J_b", "kg.m2", "inertias that the joints carry for the rotors", size=6, passed_on=True
)
I_MEASURED = Quantity("i_measured", "A", "winding currents as their sensors report them", size=6)
Q_MEASURED = Quantity("q_measured", "rad", "joint angles as the encoders report them", size=6)

N = Quantity("N", "1", "ratio of the gears", start=101.0, minimum=1e-3)
ETA = Quantity(
    "eta",
    "1",
    "efficiencies of the gears, factors on the motor torques",
    start=(0.80, 0.80, 0.80, 0.75, 0.75, 0.75),
    minimum=0.1,
    maximum=1.0,
    size=6,
)
B = Quantity(
    "b",
    "N.m.s/rad",
    "viscous friction of the gears, joint side",
    start=(8.0, 8.0, 8.0, 3.0, 3.0, 3.0),
    minimum=0.0,
    nominal=5.0,
    size=6,
)
K_T = Quantity(
    "K_t",
    "N.m/A",
    "torque constants and back-EMF constants of the motors",
    start=(0.12, 0.12, 0.12, 0.10, 0.10, 0.10),
    minimum=1e-6,
    nominal=0.1,
    size=6,
)
R_A = Quantity(
    "R_a",
    "ohm",
    "resistances of the windings",
    start=(0.5, 0.5, 0.5, 1.8, 1.8, 1.8),
    minimum=1e-3,
    size=6,
)
L_A = Quantity(
    "L_a",
    "H",
    "inductances of the windings",
    start=(6e-4, 6e-4, 6e-4, 1.5e-3, 1.5e-3, 1.5e-3),
    minimum=1e-9,
    nominal=1e-3,
    size=6,
)
J_M = Quantity(
    "J_m",
    "kg.m2",
    "inertias of the rotors, motor side",
    start=(1e-4, 1e-4, 1e-4, 2e-5, 2e-5, 2e-5),
    minimum=0.0,
    nominal=1e-4,
    size=6,
)
U_MAX = Quantity("u_max", "V", "voltage limit", start=48.0, minimum=1e-6)
KP = Quantity(
    "Kp",
    "V/rad",
    "proportional gains",
    start=(500.0, 500.0, 500.0, 400.0, 400.0, 400.0),
    minimum=0.0,
    nominal=500.0,
    size=6,
)
KI = Quantity(
    "Ki",
    "V/(rad.s)",
    "integral gains",
    start=(400.0, 400.0, 400.0, 300.0, 300.0, 300.0),
    minimum=0.0,
    nominal=500.0,
    size=6,
)
KD = Quantity(
    "Kd",
    "V.s/rad",
    "derivative gains",
    start=(2.0, 2.0, 2.0, 1.6, 1.6, 1.6),
    minimum=0.0,
    size=6,
)
F_SENSOR = Quantity("f_sensor", "Hz", "bandwidth of the current sensors", start=2000.0, minimum=1.0)

CURRENT = Quantity("current", "A", "state: winding currents", size=6)
SENSED = Quantity("sensed", "A", "state: what the current sensors show", size=6)
INTEGRAL = Quantity("integral", "V", "integral parts of the servos", size=6, nominal=1.0)

JOINT = Port("joint", TAU, QD, "gives_effort", -1, "gear outputs; the rotors' inertia is outside")

COMPONENT = Component(
    "ur5_drive",
    "Position servos, motors and gears of the six joints of a UR5.",
    ports=(JOINT,),
    device="ur5",
    source="digital twin paper of the mobile manipulator, UR5 position control and gearmotors",
)
