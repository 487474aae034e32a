"""What all fidelities of the base do alike: quantities, friction, balances, outputs."""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from ..model import SX, Model
from ..quantity import Quantity
from . import (
    BETA,
    BETA_RATE,
    PHI,
    PHI_RATE,
    POSE_THETA,
    POSE_X,
    POSE_Y,
    ROLLING,
    ROLLING_ANGLE,
    STEERING,
    STEERING_ANGLE,
    TAU_BETA,
    TAU_PHI,
    THETA,
    THETA_RATE,
    VEL_X,
    VEL_Y,
    X_RATE,
    Y_RATE,
    YAW_RATE,
    X,
    Y,
)
from .rigid_body import Geometry, Masses, rotation

L_A = Quantity(
    "l_A", "m", "distance of the steering axes from the reference point", start=0.35, minimum=0.01
)
ALPHA_A = Quantity(
    "alpha_A",
    "rad",
    "directions of the steering axes from the reference point",
    start=(1.0471975511965976, 3.141592653589793, 5.235987755982989),
    size=3,
)
E = Quantity(
    "e", "m", "distance of the wheels behind their steering axes", start=0.08, minimum=0.005, size=3
)
R = Quantity("r", "m", "wheel radii", start=0.1, minimum=0.005, size=3)
M_P = Quantity(
    "m_p", "kg", "mass of the platform without wheel sets", start=220.0, minimum=1.0, nominal=100.0
)
M_W = Quantity("m_w", "kg", "mass of one wheel set (fork and wheel)", start=10.0, minimum=0.0)
D = Quantity("d", "m", "distance of a wheel set's mass centre behind its steering axis", start=0.06)
I_P = Quantity(
    "I_p", "kg.m2", "yaw inertia of the platform about its mass centre", start=17.6, minimum=0.0
)
I_S = Quantity(
    "I_s", "kg.m2", "yaw inertia of a wheel set about its mass centre", start=0.05, minimum=1e-6
)
I_PHI = Quantity("I_phi", "kg.m2", "spin inertia of a wheel", start=0.03, minimum=1e-6)
X_G = Quantity("x_G", "m", "platform's mass centre in front of the reference point", start=0.02)
Y_G = Quantity("y_G", "m", "platform's mass centre to the left of the reference point")
F_S = Quantity("f_s", "N.m", "dry friction of each axle", start=5.0, minimum=0.0)
F_V = Quantity("f_v", "N.m.s/rad", "viscous friction of each axle", start=1.5, minimum=0.0)
W_0 = Quantity(
    "w_0", "rad/s", "speed over which dry friction changes sign", start=0.02, minimum=1e-4
)
GRAVITY = Quantity("gravity", "m/s2", "gravity", start=9.81, minimum=0.0)
ROLLING_FLOOR = 1e-6
"""Rolling speed [m/s] over which the absolute value is rounded."""


class Motion(NamedTuple):
    """Configuration and velocities; `rates` are in the world, `u` is the same in platform axes."""

    x: SX
    y: SX
    theta: SX
    beta: SX
    phi: SX
    rates: SX
    u: SX
    to_platform: SX


def motion_states(m: Model) -> Motion:
    """Declare the states that every fidelity has."""
    beta, phi = m.state(STEERING_ANGLE), m.state(ROLLING_ANGLE)
    x, y, theta = m.state(POSE_X), m.state(POSE_Y), m.state(POSE_THETA)
    rates = ca.vertcat(m.state(VEL_X), m.state(VEL_Y), m.state(YAW_RATE))
    to_platform = rotation(theta)
    return Motion(x, y, theta, beta, phi, rates, to_platform @ rates, to_platform)


def geometry(m: Model) -> Geometry:
    """Declare the geometry."""
    distance, direction = m.parameter(L_A), m.parameter(ALPHA_A)
    return Geometry(
        distance * ca.cos(direction), distance * ca.sin(direction), m.parameter(E), m.parameter(R)
    )


class Forces(NamedTuple):
    """Generalised forces on (x, y, theta) in platform axes, on beta and on phi; normal forces."""

    pose: SX
    beta: SX
    phi: SX
    normal: SX


def forces(
    m: Model, g: Geometry, motion: Motion, beta_rate: SX, phi_rate: SX
) -> tuple[Masses, Forces]:
    """Declare inputs and masses, open the balances, and add up what acts on the base.

    Axle friction is f_s tanh(q'/w_0) + f_v q' on all six axles. Each wheel carries a third of the
    weight.
    """
    tau_beta, tau_phi = m.input(TAU_BETA), m.input(TAU_PHI)
    m_p, m_w, d = m.parameter(M_P), m.parameter(M_W), m.parameter(D)
    i_p, i_s, i_phi = m.parameter(I_P), m.parameter(I_S), m.parameter(I_PHI)
    x_g, y_g, gravity = m.parameter(X_G), m.parameter(Y_G), m.parameter(GRAVITY)
    f_s, f_v, w_0 = m.parameter(F_S), m.parameter(F_V), m.parameter(W_0)

    load = m.balance("load", "position", value=ca.vertcat(x_g, y_g, 0))
    centre = ca.vertcat(x_g, y_g, 0) + load.effort
    body = m.balance(
        "body",
        "body",
        velocity=ca.vertcat(motion.u[0], motion.u[1], 0),
        rate=ca.vertcat(0, 0, motion.u[2]),
        gravity=ca.vertcat(0, 0, -gravity),
        position=ca.vertcat(motion.x, motion.y, 0),
        rotation=motion.to_platform.T,
        mass=m_p + 3 * m_w,
        first_moment=m_p * centre + m_w * ca.vertcat(ca.sum1(g.x), ca.sum1(g.y), 0),
    )
    steering = m.balance(
        "steering", "rotation", velocity=beta_rate, angle=motion.beta, load=tau_beta
    )
    rolling = m.balance("rolling", "rotation", velocity=phi_rate, angle=motion.phi, load=tau_phi)

    masses = Masses(
        m_p + body.mass,
        m_p * centre[0] + body.first_moment[0],
        m_p * centre[1] + body.first_moment[1],
        i_p + m_p * (centre[0] ** 2 + centre[1] ** 2) + body.inertia[2, 2],
        m_w,
        d,
        i_s,
        i_phi,
    )
    normal = ca.repmat(((masses.mass + 3 * m_w) * gravity - body.effort[2]) / 3, 3)
    speed = ca.sqrt((g.r * phi_rate) ** 2 + ROLLING_FLOOR**2)
    pivot = m.balance("pivot", "pivot", spin=beta_rate + motion.u[2], rolling=speed, normal=normal)

    friction_beta = f_s * ca.tanh(beta_rate / w_0) + f_v * beta_rate
    friction_phi = f_s * ca.tanh(phi_rate / w_0) + f_v * phi_rate
    m.loss("axles", ca.dot(friction_beta, beta_rate) + ca.dot(friction_phi, phi_rate))
    m.port(STEERING, tau_beta, beta_rate)
    m.port(ROLLING, tau_phi, phi_rate)
    on_pose = ca.vertcat(body.effort[0], body.effort[1], body.effort[5] + ca.sum1(pivot.effort))
    on_beta = tau_beta - friction_beta + steering.effort + pivot.effort
    return masses, Forces(on_pose, on_beta, tau_phi - friction_phi + rolling.effort, normal)


def finish(m: Model, motion: Motion, acceleration: SX, beta_rate: SX, phi_rate: SX) -> None:
    """Set the derivatives of the shared states and output the motion.

    `acceleration` is xi'' in platform axes: R xi''.
    """
    m.derivative(motion.x, motion.rates[0])
    m.derivative(motion.y, motion.rates[1])
    m.derivative(motion.theta, motion.rates[2])
    m.derivative(motion.beta, beta_rate)
    m.derivative(motion.phi, phi_rate)
    m.derivative(motion.rates, motion.to_platform.T @ acceleration)
    m.output(X, motion.x)
    m.output(Y, motion.y)
    m.output(THETA, motion.theta)
    m.output(X_RATE, motion.rates[0])
    m.output(Y_RATE, motion.rates[1])
    m.output(THETA_RATE, motion.rates[2])
    m.output(BETA, motion.beta)
    m.output(PHI, motion.phi)
    m.output(BETA_RATE, beta_rate)
    m.output(PHI_RATE, phi_rate)
