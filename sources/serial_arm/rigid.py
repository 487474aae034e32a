"""Rigid links on a mount at rest.

    M(q) q'' + C(q, q') q' + g(q) + J_added q'' = tau

solved by articulated bodies, without forming M. The mount's pose counts (it may hang from a wall or
stand on a slope), its motion does not. The wrench is the one of a mount at rest, `arm_bias`, and
`arm_inertia` is what the arm weighs as if its joints were locked, which is nearly so under stiff
servos. A moving mount that has to feel the arm truly wants `rigid_moving`.

Not modelled: motion of the mount, elasticity of joints and links, gyroscopic moments of the rotors.

Source: Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 7.
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity, Solver
from ..model import Model
from .links import (
    at_rest,
    joint_efforts,
    joint_inputs,
    joint_states,
    links,
    output_motion,
    output_wrench,
    read_mount,
)

FIDELITY = Fidelity(level=1, solver=Solver("rk4", 1e-3))


def equations(m: Model) -> None:
    """Collect the equations."""
    mount = at_rest(read_mount(m))
    tau, added = joint_inputs(m)
    q, qd = joint_states(m)
    torque = tau + joint_efforts(m, qd, q, tau)
    arm = links(m, mount, q, qd)
    dynamics = arm.accelerate(torque, added)
    m.derivative(q, qd)
    m.derivative(qd, dynamics.acceleration)
    output_motion(m, mount, q, qd, arm.posture, tau)
    locked = arm.posture.mass_properties().matrix()
    output_wrench(m, mount, locked, dynamics.bias, dynamics.bias)
    kinetic, potential = arm.energy()
    m.stored_energy(kinetic + potential + ca.dot(added, qd**2) / 2)
