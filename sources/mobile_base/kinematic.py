"""Unicycle: the pose follows from the wheel speeds, each wheel turns its share of the inertia.

    (J_eq + J) w' = tau        for each wheel
    v = r (w_r + w_l)/2,   w_z = r (w_r - w_l)/track
    x' = v cos phi,   y' = v sin phi,   phi' = w_z

The lumped inertia J_eq keeps the interface of the other fidelities: torque in, wheel speed out.

Not modelled: slip, casters, coupling of the wheels by the body, reaction of the arm (its inputs are
not read).

Source: digital twin paper, inverse kinematics (Eq. 1); e.g. Siciliano et al., Robotics, 2009,
ch. 11.
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity, Solver
from ..model import SX, Model
from ..quantity import Quantity
from ..wheel_contact import R
from . import (
    AXLE_L,
    AXLE_R,
    J_L,
    J_R,
    PHI,
    PHI_L,
    PHI_R,
    POSE_PHI,
    POSE_X,
    POSE_Y,
    TAU_L,
    TAU_R,
    TRACK,
    W_L,
    W_R,
    W_Z,
    V,
    X,
    Y,
    Z,
)
from .mount import read_mount, write_planar_motion
from .wheels import wheel_parameter

FIDELITY = Fidelity(level=0, solver=Solver("rk4", 1e-3))
J_EQ = Quantity(
    "J_eq",
    "kg.m2",
    "inertia that each drive wheel turns, wheel and body",
    start=0.6,
    minimum=1e-4,
    nominal=0.1,
)
ANGLE_L = Quantity("angle_l", "rad", "state: angle of the left drive wheel")
ANGLE_R = Quantity("angle_r", "rad", "state: angle of the right drive wheel")
SPEED_L = Quantity("speed_l", "rad/s", "state: speed of the left drive wheel")
SPEED_R = Quantity("speed_r", "rad/s", "state: speed of the right drive wheel")


def equations(m: Model) -> None:
    """Collect the equations."""
    mount = read_mount(m)
    radius, track, inertia = wheel_parameter(m, R), m.parameter(TRACK), m.parameter(J_EQ)

    def wheel(
        name: str, torque: Quantity, added: Quantity, angle: Quantity, speed: Quantity
    ) -> tuple[SX, SX, SX, SX]:
        tau, carried = m.input(torque), m.input(added)
        phi, w = m.state(angle), m.state(speed)
        axle = m.balance(name, "rotation", velocity=w, angle=phi, load=tau, radius=radius)
        acceleration = (tau + axle.effort) / (inertia + carried)
        m.derivative(phi, w)
        m.derivative(w, acceleration)
        m.stored_energy((inertia + carried) * w**2 / 2)
        return tau, phi, w, acceleration

    tau_l, phi_l, w_l, alpha_l = wheel("left_axle", TAU_L, J_L, ANGLE_L, SPEED_L)
    tau_r, phi_r, w_r, alpha_r = wheel("right_axle", TAU_R, J_R, ANGLE_R, SPEED_R)
    x, y, phi = m.state(POSE_X), m.state(POSE_Y), m.state(POSE_PHI)
    v, w_z = radius * (w_r + w_l) / 2, radius * (w_r - w_l) / track
    m.derivative(x, v * ca.cos(phi))
    m.derivative(y, v * ca.sin(phi))
    m.derivative(phi, w_z)

    for quantity, value in (
        (X, x),
        (Y, y),
        (PHI, phi),
        (Z, radius),
        (V, v),
        (W_Z, w_z),
        (W_L, w_l),
        (W_R, w_r),
        (PHI_L, phi_l),
        (PHI_R, phi_r),
    ):
        m.output(quantity, value)
    forward = radius * (alpha_r + alpha_l) / 2
    turning = radius * (alpha_r - alpha_l) / track
    write_planar_motion(m, mount, (x, y, phi), (v, 0, w_z), (forward, w_z * v, turning))
    m.port(AXLE_L, tau_l, w_l)
    m.port(AXLE_R, tau_r, w_r)
