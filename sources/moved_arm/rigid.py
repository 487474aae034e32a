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

from ..component import Fidelity, Solver
from ..laws.rigid_chain import Chain, Posture, standard_dh
from ..model import SX, Model
from . import (
    F_0,
    F_C,
    F_V,
    GAIN,
    GRAVITY,
    H_X,
    H_Y,
    H_Z,
    J_M,
    J_XX,
    J_XY,
    J_XZ,
    J_YY,
    J_YZ,
    J_ZZ,
    JOINT,
    QD,
    QDD,
    TAU,
    W_0,
    I,
    Q,
)

# No states of its own; bristles that stick within 0.1 mrad need short steps.
FIDELITY = Fidelity(level=0, solver=Solver("rodas3", 1e-4))


def chain(m: Model) -> Chain:
    """The device's geometry and masses with the parameters' moments and inertias."""
    mass = m.constant("mass")
    nothing = [[0.0] * 3] * 6, [[0.0] * 6] * 6
    bare = standard_dh(m.constant("d"), m.constant("a"), m.constant("alpha"), mass, *nothing)
    x, y, z = (m.parameter(quantity) for quantity in (H_X, H_Y, H_Z))
    xx, yy, zz = (m.parameter(quantity) for quantity in (J_XX, J_YY, J_ZZ))
    xy, xz, yz = (m.parameter(quantity) for quantity in (J_XY, J_XZ, J_YZ))
    links = []
    for k, link in enumerate(bare.links):
        inertia = ca.vertcat(
            ca.horzcat(xx[k], xy[k], xz[k]),
            ca.horzcat(xy[k], yy[k], yz[k]),
            ca.horzcat(xz[k], yz[k], zz[k]),
        )
        moment = ca.vertcat(x[k], y[k], z[k])
        links.append(replace(link, first_moment=moment, inertia=inertia))
    return replace(bare, links=tuple(links))


def equations(m: Model) -> None:
    """Collect the equations."""
    q, qd, qdd = m.input(Q), m.input(QD), m.input(QDD)
    m.input_rate(q, qd)
    m.input_rate(qd, qdd)
    posture, zero = Posture(chain(m), q), ca.SX.zeros(3)
    gravity = m.parameter(GRAVITY)
    moving, _ = posture.inverse_dynamics(
        qd,
        qdd,
        base_rate=zero,
        base_acceleration=ca.vertcat(0, 0, gravity),
        base_angular_acceleration=zero,
    )
    rotor = m.parameter(J_M)
    dry = m.parameter(F_C) * ca.tanh(qd / m.parameter(W_0)) + m.parameter(F_0)
    friction = m.parameter(F_V) * qd + dry
    load: SX = moving + rotor * qdd
    effects = m.balance("joint", "rotation", velocity=qd, angle=q, load=load).effort
    effects += ca.vertcat(
        *[
            m.balance(f"joint_{k + 1}", "rotation", velocity=qd[k], angle=q[k], load=load[k]).effort
            for k in range(6)
        ]
    )
    torque = load + friction - effects
    m.output(TAU, torque)
    m.output(I, torque / m.parameter(GAIN))
    m.port(JOINT, torque, qd)
    rates = posture.rates(qd, zero)
    velocities = posture.velocities(rates, zero, zero)
    height = posture.mass_properties().first_moment[2]
    kinetic = posture.kinetic_energy(rates, velocities)
    m.stored_energy(kinetic + gravity * height + ca.dot(rotor, qd**2) / 2)
    m.loss("friction", ca.dot(friction, qd))
