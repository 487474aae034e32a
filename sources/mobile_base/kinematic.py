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

from .. import mobile_base as qs
from ..component import Fidelity, Solver
from ..model import SX, Model
from ..quantity import Quantity
from ..wheel_contact import R
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
    r = wheel_parameter(m, R)
    p = m.parameters(qs.TRACK, J_EQ)

    def wheel(
        name: str, torque: Quantity, added: Quantity, angle: Quantity, speed: Quantity
    ) -> tuple[SX, SX, SX, SX]:
        tau, carried = m.input(torque), m.input(added)
        phi, w = m.state(angle), m.state(speed)
        axle = m.balance(name, "rotation", velocity=w, angle=phi, load=tau, radius=r)
        acceleration = (tau + axle.effort) / (p.J_eq + carried)
        m.derivative(phi, w)
        m.derivative(w, acceleration)
        m.stored_energy((p.J_eq + carried) * w**2 / 2)
        return tau, phi, w, acceleration

    tau_l, phi_l, w_l, alpha_l = wheel("left_axle", qs.TAU_L, qs.J_L, ANGLE_L, SPEED_L)
    tau_r, phi_r, w_r, alpha_r = wheel("right_axle", qs.TAU_R, qs.J_R, ANGLE_R, SPEED_R)
    x = m.states(qs.POSE_X, qs.POSE_Y, qs.POSE_PHI)
    v, w_z = r * (w_r + w_l) / 2, r * (w_r - w_l) / p.track
    m.derivative(x.pose_x, v * ca.cos(x.pose_phi))
    m.derivative(x.pose_y, v * ca.sin(x.pose_phi))
    m.derivative(x.pose_phi, w_z)

    for quantity, value in (
        (qs.X, x.pose_x),
        (qs.Y, x.pose_y),
        (qs.PHI, x.pose_phi),
        (qs.Z, r),
        (qs.V, v),
        (qs.W_Z, w_z),
        (qs.W_L, w_l),
        (qs.W_R, w_r),
        (qs.PHI_L, phi_l),
        (qs.PHI_R, phi_r),
    ):
        m.output(quantity, value)
    forward = r * (alpha_r + alpha_l) / 2
    turning = r * (alpha_r - alpha_l) / p.track
    write_planar_motion(
        m, mount, (x.pose_x, x.pose_y, x.pose_phi), (v, 0, w_z), (forward, w_z * v, turning)
    )
    m.port(qs.AXLE_L, tau_l, w_l)
    m.port(qs.AXLE_R, tau_r, w_r)
