"""Rigid links on a moving mount that feels them.

    M(q) q'' + C q' + g + J_added q'' + (inertial torques of the mount's motion) = tau
    wrench = arm_inertia [a_0; alpha_0] + arm_bias

`arm_inertia` (6x6) and `arm_bias` are the articulated inertia and bias of the arm with its joints
free under the present torques: neither depends on an acceleration, so that mount and arm can be
solved together without iteration. `arm_bias` includes gravity.

Only the mount's angular velocity, its accelerations and its attitude enter the joints' motion; its
velocity and position enter the stored energy.

Not modelled: elasticity of joints and links, gyroscopic moments of the rotors.

Source: Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 7 and 9.
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity, Solver
from ..model import Model
from .links import (
    joint_efforts,
    joint_inputs,
    joint_states,
    links,
    move_mount,
    output_motion,
    output_wrench,
    read_mount,
)

FIDELITY = Fidelity(level=4, solver=Solver("rk4", 1e-3))


def equations(m: Model) -> None:
    """Collect the equations."""
    mount = read_mount(m)
    move_mount(m, mount)
    tau, added = joint_inputs(m)
    q, qd = joint_states(m)
    torque = tau + joint_efforts(m, qd, q, tau)
    arm = links(m, mount, q, qd)
    dynamics = arm.accelerate(torque, added)
    m.derivative(q, qd)
    m.derivative(qd, dynamics.acceleration)
    output_motion(m, mount, q, qd, arm.posture, tau)
    acceleration = ca.vertcat(mount.acceleration, mount.angular_acceleration)
    wrench = dynamics.inertia @ acceleration + dynamics.bias
    output_wrench(m, mount, dynamics.inertia, dynamics.bias, wrench)
    kinetic, potential = arm.energy()
    m.stored_energy(kinetic + potential + ca.dot(added, qd**2) / 2)
