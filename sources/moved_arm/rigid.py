"""Inverse dynamics of rigid links with friction in the joints.

    tau = M(q) q'' + C(q, q') q' + g(q) + J_m q'' + F_v q' + F_c tanh(q' / w_0) + F_0
    i = tau / K

Link i is given by its mass, first moment and inertia in axes of the frame that turns with joint i,
about its origin. A current and a motion do not determine all of them: only their base parameters
count.

Not modelled: elasticity of the joints, gyroscopic moments of the rotors.

Source: Mamedov, Mikhel, Practical aspects of model-based collision detection, Frontiers in Robotics
and AI, 2020; Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 5.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca

from .. import moved_arm as qs
from ..component import Fidelity, Solver
from ..laws.chain import Chain, standard_dh
from ..laws.joints import Joints
from ..laws.rigid_chain import Posture
from ..model import SX, Model
from ..serial_arm.links import chain as base_chain

# No states of its own; bristles that stick within 0.1 mrad need short steps.
FIDELITY = Fidelity(level=0, solver=Solver("rodas3", 1e-4))


def chain(m: Model) -> Chain:
    """The device's links, with what can be told of them as parameters.

    Base parameters; where the device gives DH data, all first moments and inertias.
    """
    if "alpha" not in m.values:
        return base_chain(m)
    mass = m.constant("mass")
    nothing = [[0.0] * 3] * 6, [[0.0] * 6] * 6
    bare = standard_dh(m.constant("d"), m.constant("a"), m.constant("alpha"), mass, *nothing)
    p = m.parameters(qs.H_X, qs.H_Y, qs.H_Z, qs.J_XX, qs.J_YY, qs.J_ZZ, qs.J_XY, qs.J_XZ, qs.J_YZ)
    links = []
    for k, link in enumerate(bare.links):
        inertia = ca.vertcat(
            ca.horzcat(p.J_xx[k], p.J_xy[k], p.J_xz[k]),
            ca.horzcat(p.J_xy[k], p.J_yy[k], p.J_yz[k]),
            ca.horzcat(p.J_xz[k], p.J_yz[k], p.J_zz[k]),
        )
        moment = ca.vertcat(p.h_x[k], p.h_y[k], p.h_z[k])
        links.append(replace(link, first_moment=moment, inertia=inertia))
    return replace(bare, links=tuple(links))


def equations(m: Model) -> None:
    """Collect the equations."""
    joints = Joints.of_device(m)
    u = m.inputs(*(joints.sized(each) for each in (qs.Q, qs.QD, qs.QDD)))
    m.input_rate(u.q, u.qd)
    m.input_rate(u.qd, u.qdd)
    posture, zero = Posture(chain(m), u.q), ca.SX.zeros(3)
    p = m.parameters(
        qs.GRAVITY,
        joints.sized(qs.J_M),
        joints.sized(qs.F_C),
        qs.W_0,
        *(joints.sized(each) for each in (qs.F_0, qs.F_V, qs.GAIN)),
    )
    moving, _ = posture.inverse_dynamics(
        u.qd,
        u.qdd,
        base_rate=zero,
        base_acceleration=ca.vertcat(0, 0, p.gravity),
        base_angular_acceleration=zero,
    )
    dry = p.F_c * ca.tanh(u.qd / p.w_0) + p.F_0
    friction = p.F_v * u.qd + dry
    load: SX = moving + p.J_m * u.qdd
    effects = joints.efforts(m, speed=u.qd, angle=u.q, load=load)
    torque = load + friction - effects
    m.output(joints.sized(qs.TAU), torque)
    m.output(joints.sized(qs.I), torque / p.K)
    m.port(joints.port(qs.JOINT), torque, u.qd)
    rates = posture.rates(u.qd, zero)
    velocities = posture.velocities(rates, zero, zero, u.qd)
    height = posture.mass_properties().first_moment[2]
    kinetic = posture.kinetic_energy(rates, velocities)
    m.stored_energy(kinetic + p.gravity * height + ca.dot(p.J_m, u.qd**2) / 2)
    m.loss("friction", ca.dot(friction, u.qd))
