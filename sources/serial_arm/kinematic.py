"""Joints that know nothing of each other: constant inertias, no gravity, exact kinematics.

    q' = qd,   (J_link + J_added) qd' = tau
    T_0n = product of T_i Rz(q_i), or of T_i Tz(q_i) where a joint slides, and the flange

For trying out a controller or a path. The mount's pose moves the tool; nothing acts on the mount.

Not modelled: gravity, coupling of the joints, masses on the mount, payload.

Source: Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 4.
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity
from ..laws.joints import Joints
from ..laws.rigid_chain import Posture
from ..model import Model
from ..quantity import Quantity
from .links import (
    at_rest,
    chain,
    joint_efforts,
    joint_inputs,
    joint_states,
    output_motion,
    output_wrench,
    read_mount,
)

FIDELITY = Fidelity(level=0)
J_LINK = Quantity(
    "J_link",
    "kg.m2",
    "inertias of the links as the joints feel them",
    start=1.0,
    minimum=1e-9,
    size=2,
)


def equations(m: Model) -> None:
    """Collect the equations."""
    mount = read_mount(m)
    tau, added = joint_inputs(m)
    p = m.parameters(Joints.of_device(m).sized(J_LINK))
    q, qd = joint_states(m)
    inertia = p.J_link + added
    m.derivative(q, qd)
    m.derivative(qd, (tau + joint_efforts(m, qd, q, tau)) / inertia)
    output_motion(m, mount, q, qd, Posture(chain(m, adjustable=False), q), tau)
    m.leaves_out("mass of the links", sum(m.constant("mass")), "kg")
    zero = ca.SX.zeros(6)
    output_wrench(m, at_rest(mount), ca.SX.zeros(6, 6), zero, zero)
    m.stored_energy(ca.dot(inertia, qd**2) / 2)
