"""Arm whose motion is given: joint angles, speeds and accelerations in, currents out."""

from __future__ import annotations

from ..component import Component, Port
from ..quantity import Quantity

Q = Quantity("q", "rad", "joint angles", size=6)
QD = Quantity("qd", "rad/s", "joint speeds", size=6)
QDD = Quantity("qdd", "rad/s2", "joint accelerations", size=6)
TAU = Quantity("tau", "N.m", "torques of the motors, behind the gears", size=6, nominal=50.0)
I = Quantity("i", "A", "currents of the motors", size=6)  # noqa: E741

H_X = Quantity("h_x", "kg.m", "first moments of the links about their joints", size=6)
H_Y = Quantity("h_y", "kg.m", "first moments of the links about their joints", size=6)
H_Z = Quantity("h_z", "kg.m", "first moments of the links about their joints", size=6)
J_XX = Quantity("J_xx", "kg.m2", "inertias of the links about their joints", size=6)
J_YY = Quantity("J_yy", "kg.m2", "inertias of the links about their joints", size=6)
J_ZZ = Quantity("J_zz", "kg.m2", "inertias of the links about their joints", size=6)
J_XY = Quantity("J_xy", "kg.m2", "products of inertia of the links", size=6)
J_XZ = Quantity("J_xz", "kg.m2", "products of inertia of the links", size=6)
J_YZ = Quantity("J_yz", "kg.m2", "products of inertia of the links", size=6)
J_M = Quantity("J_m", "kg.m2", "inertias of the rotors, behind the gears", minimum=0.0, size=6)
GAIN = Quantity("K", "N.m/A", "torques per current, behind the gears", size=6, start=10.0)
F_V = Quantity("F_v", "N.m.s/rad", "viscous friction", minimum=0.0, size=6)
F_C = Quantity("F_c", "N.m", "Coulomb friction", minimum=0.0, size=6)
F_0 = Quantity("F_0", "N.m", "constant part of the friction, or offset of the current", size=6)
W_0 = Quantity("w_0", "rad/s", "speed over which the sign is smoothed", start=1e-3, minimum=1e-6)
GRAVITY = Quantity("gravity", "m/s2", "gravity, along the base's -z axis", start=9.81)

JOINT = Port("joint", TAU, QD, "gives_effort", +1, "what the motors put into the joints")

COMPONENT = Component(
    "moved_arm",
    "Serial arm on a fixed base that is moved as given.",
    ports=(JOINT,),
    device="ur10e",
    source="Mamedov, Mikhel, Practical aspects of model-based collision detection, Frontiers in "
    "Robotics and AI, 2020; Featherstone, Rigid Body Dynamics Algorithms, 2008",
)
