"""Joints that know nothing of each other: constant inertias, no gravity, exact kinematics.

    q' = qd,   (J_link + J_added) qd' = tau
    T_06 = product of Rz(q_i) Tz(d_i) Tx(a_i) Rx(alpha_i)

For trying out a controller or a path. The mount's pose moves the tool; nothing acts on the mount.

Not modelled: gravity, coupling of the joints, masses on the mount, payload.

Source: UR5 Denavit-Hartenberg table of Universal Robots.
"""

from __future__ import annotations

import casadi as ca

from .. import ur5_arm as qs
from ..component import Fidelity
from ..laws.rigid_chain import Posture
from ..model import Model
from ..quantity import Quantity
from .links import at_rest, chain, joint_efforts, output_motion, output_wrench, read_mount

FIDELITY = Fidelity(level=0)
J_LINK = Quantity(
    "J_link",
    "kg.m2",
    "inertias of the links as the joints feel them",
    start=(1.680415, 2.264805, 0.684898, 0.017157, 0.003837, 0.000132),
    minimum=1e-9,
    size=6,
)


def equations(m: Model) -> None:
    """Collect the equations."""
    mount = read_mount(m)
    u = m.inputs(qs.TAU, qs.J_ADDED)
    p = m.parameters(J_LINK)
    x = m.states(qs.ANGLE, qs.SPEED)
    inertia = p.J_link + u.J_added
    q, qd = x.angle, x.speed
    m.derivative(q, qd)
    m.derivative(qd, (u.tau + joint_efforts(m, qd, q, u.tau)) / inertia)
    output_motion(m, mount, q, qd, Posture(chain(m), q), u.tau)
    m.leaves_out("mass of the links", sum(m.constant("mass")), "kg")
    zero = ca.SX.zeros(6)
    output_wrench(m, at_rest(mount), ca.SX.zeros(6, 6), zero, zero)
    m.stored_energy(ca.dot(inertia, qd**2) / 2)
