"""Rigid links behind elastic gears, on a mount at rest.

    (J_hub + J_added) theta'' = tau - K (theta - q) - D (theta' - q')
    M(q) q'' + C(q, q') q' + g(q) + J_out q'' = K (theta - q) + D (theta' - q')

theta is the gear's output without its twist, as the motor encoder sees it: the outputs `q`, `qd`
and the port of the joints belong to it, the tool to the links (`q_link`, `qd_link`). The states are
theta and the twist theta - q, so that a pose to start from is the same as in the other fidelities.
Mount as in `rigid`.

Not modelled: hysteresis and stiffening of the gear, elastic links, motion of the mount.

Source: Spong, J. Dyn. Sys. Meas. Control 109, 1987, 310-319.
"""

from __future__ import annotations

import casadi as ca

from .. import serial_arm as qs
from ..component import Fidelity, Solver
from ..laws.joints import Joints
from ..model import Model
from ..quantity import Quantity
from .links import (
    at_rest,
    joint_efforts,
    joint_inputs,
    links,
    output_motion,
    output_wrench,
    read_mount,
)

# RK4 is stable up to sqrt(K/J) = 2.8e4 1/s; the last link of a UR5 swings with 6e3 1/s.
FIDELITY = Fidelity(level=5, solver=Solver("rk4", 1e-4))
K = Quantity(
    "K",
    "N.m/rad",
    "torsional stiffness of the gears",
    start=1e4,
    minimum=0.0,
    nominal=1e4,
    size=2,
)
D = Quantity(
    "D",
    "N.m.s/rad",
    "damping of the gears' twist",
    start=10.0,
    minimum=0.0,
    nominal=10.0,
    size=2,
)
J_HUB = Quantity(
    "J_hub",
    "kg.m2",
    "inertia of each gear on the motor's side of its spring, seen at the joint",
    start=1e-3,
    minimum=1e-9,
    nominal=1e-3,
)
J_OUT = Quantity(
    "J_out",
    "kg.m2",
    "inertia of each gear's output beyond that of the links",
    minimum=0.0,
    nominal=1e-3,
)
TWIST = Quantity(
    "twist", "rad", "state: twist of the gears, motor's side less link", nominal=1e-3, size=2
)
TWIST_RATE = Quantity("twist_rate", "rad/s", "state: rate of the twist", nominal=0.1, size=2)
Q_LINK = Quantity("q_link", "rad", "angles of the links behind the gears", size=2)
QD_LINK = Quantity("qd_link", "rad/s", "speeds of the links behind the gears", size=2)


def equations(m: Model) -> None:
    """Collect the equations."""
    mount = at_rest(read_mount(m))
    tau, added = joint_inputs(m)
    joints = Joints.of_device(m)
    p = m.parameters(joints.sized(K), joints.sized(D), J_HUB)
    x = m.states(*(joints.sized(each) for each in (qs.ANGLE, qs.SPEED, TWIST, TWIST_RATE)))
    theta, thetad = x.angle, x.speed
    q, qd = theta - x.twist, thetad - x.twist_rate
    hub = added + p.J_hub
    driving = tau + joint_efforts(m, thetad, theta, tau)
    through = p.K * x.twist + p.D * x.twist_rate
    if not any(joints.prismatic):
        through -= m.balance(
            "gear", "compliance", deflection=x.twist, rate=x.twist_rate, stiffness=p.K, damping=p.D
        ).effort
    arm = links(m, mount, q, qd)
    output = m.parameter(J_OUT) * ca.SX.ones(len(joints))
    dynamics = arm.accelerate(through, output)
    acceleration = (driving - through) / hub
    m.derivative(theta, thetad)
    m.derivative(x.twist, x.twist_rate)
    m.derivative(thetad, acceleration)
    m.derivative(x.twist_rate, acceleration - dynamics.acceleration)
    output_motion(m, mount, theta, thetad, arm.posture, tau)
    m.output(joints.sized(Q_LINK), q)
    m.output(joints.sized(QD_LINK), qd)
    locked = arm.posture.mass_properties().matrix()
    output_wrench(m, mount, locked, dynamics.bias, dynamics.bias)
    kinetic, potential = arm.energy()
    m.stored_energy(kinetic + potential + ca.dot(output, qd**2) / 2)
    m.stored_energy(ca.dot(hub, thetad**2) / 2 + ca.dot(p.K, x.twist**2) / 2)
    m.loss("gears", ca.dot(p.D, x.twist_rate**2))
