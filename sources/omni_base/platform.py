"""What all fidelities of the base do alike: quantities, friction, balances, outputs."""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from .. import omni_base as qs
from ..declarations import Symbols
from ..model import SX, Model
from ..quantity import Quantity
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
    x = m.states(
        qs.STEERING_ANGLE,
        qs.ROLLING_ANGLE,
        qs.POSE_X,
        qs.POSE_Y,
        qs.POSE_THETA,
        qs.VEL_X,
        qs.VEL_Y,
        qs.YAW_RATE,
    )
    rates = ca.vertcat(x.vel_x, x.vel_y, x.yaw_rate)
    to_platform = rotation(x.pose_theta)
    return Motion(
        x.pose_x,
        x.pose_y,
        x.pose_theta,
        x.steering_angle,
        x.rolling_angle,
        rates,
        to_platform @ rates,
        to_platform,
    )


def geometry(m: Model) -> Geometry:
    """Declare the geometry."""
    p = m.parameters(L_A, ALPHA_A, E, R)
    return Geometry(p.l_A * ca.cos(p.alpha_A), p.l_A * ca.sin(p.alpha_A), p.e, p.r)


class Forces(NamedTuple):
    """Generalised forces on (x, y, theta) in platform axes, on beta and on phi; normal forces."""

    pose: SX
    beta: SX
    phi: SX
    normal: SX


class Bodies(NamedTuple):
    """Masses with what effects add, and what they and gravity do.

    Attributes:
        masses: with those of effects.
        moment: first moment of all (2) [kg.m].
        weight: of all [N].
        wrench: of effects on the base (6).
        forks: torques on the forks (3) [N.m], where gravity leans.
    """

    masses: Masses
    moment: SX
    weight: SX
    wrench: SX
    forks: SX


def bodies(m: Model, g: Geometry, motion: Motion, p: Symbols, beta_rate: SX) -> Bodies:
    """Open the balances of the platform and gather its masses."""
    load = m.balance("load", "position", value=ca.vertcat(p.x_G, p.y_G, 0))
    centre = ca.vertcat(p.x_G, p.y_G, 0) + load.effort
    behind_x, behind_y = (-p.m_w * p.d * f(motion.beta) for f in (ca.cos, ca.sin))
    sets_x, sets_y = (ca.sum1(p.m_w * at + b) for at, b in ((g.x, behind_x), (g.y, behind_y)))
    first_moment = p.m_p * centre + ca.vertcat(sets_x, sets_y, 0)
    body = m.balance(
        "body",
        "body",
        velocity=ca.vertcat(motion.u[0], motion.u[1], 0),
        rate=ca.vertcat(0, 0, motion.u[2]),
        gravity=ca.vertcat(0, 0, -p.gravity),
        position=ca.vertcat(motion.x, motion.y, 0),
        rotation=motion.to_platform.T,
        mass=p.m_p + 3 * p.m_w,
        first_moment=first_moment,
    )
    masses = Masses(
        p.m_p + body.mass,
        p.m_p * centre[0] + body.first_moment[0],
        p.m_p * centre[1] + body.first_moment[1],
        p.I_p + p.m_p * (centre[0] ** 2 + centre[1] ** 2) + body.inertia[2, 2],
        p.m_w,
        p.d,
        p.I_s,
        p.I_phi,
    )
    weight = (masses.mass + 3 * p.m_w) * p.gravity - body.effort[2]
    forks = behind_x * body.lean[1] - behind_y * body.lean[0]
    if not body.lean.is_zero():
        m.supply(ca.dot(forks, beta_rate))
    moment = first_moment[:2] + body.first_moment[:2]
    return Bodies(masses, moment, weight, body.effort, forks)


def forces(
    m: Model, g: Geometry, motion: Motion, beta_rate: SX, phi_rate: SX
) -> tuple[Masses, Forces]:
    """Declare inputs and masses, open the balances, and add up what acts on the base.

    Axle friction is f_s tanh(q'/w_0) + f_v q' on all six axles. Each wheel carries a third of the
    weight.
    """
    u = m.inputs(qs.TAU_BETA, qs.TAU_PHI)
    p = m.parameters(M_P, M_W, D, I_P, I_S, I_PHI, X_G, Y_G, GRAVITY, F_S, F_V, W_0)
    body = bodies(m, g, motion, p, beta_rate)
    steering = m.balance(
        "steering", "rotation", velocity=beta_rate, angle=motion.beta, load=u.tau_beta
    )
    rolling = m.balance("rolling", "rotation", velocity=phi_rate, angle=motion.phi, load=u.tau_phi)
    normal = ca.repmat(body.weight / 3, 3)
    signals = pivot_signals(g.r, motion, beta_rate, phi_rate, normal)
    pivot = m.balance("pivot", "pivot", **signals).effort

    friction_beta = p.f_s * ca.tanh(beta_rate / p.w_0) + p.f_v * beta_rate
    friction_phi = p.f_s * ca.tanh(phi_rate / p.w_0) + p.f_v * phi_rate
    m.loss("axles", ca.dot(friction_beta, beta_rate) + ca.dot(friction_phi, phi_rate))
    m.port(qs.STEERING, u.tau_beta, beta_rate)
    m.port(qs.ROLLING, u.tau_phi, phi_rate)
    on_beta = u.tau_beta - friction_beta + steering.effort + pivot + body.forks
    on_phi = u.tau_phi - friction_phi + rolling.effort
    return body.masses, Forces(on_pose(body.wrench, pivot), on_beta, on_phi, normal)


def pivot_signals(r: SX, motion: Motion, beta_rate: SX, phi_rate: SX, normal: SX) -> dict[str, SX]:
    """Signals of the contact patches' torques about the vertical."""
    speed = ca.sqrt((r * phi_rate) ** 2 + ROLLING_FLOOR**2)
    return {"spin": beta_rate + motion.u[2], "rolling": speed, "normal": normal}


def on_pose(wrench: SX, pivot: SX) -> SX:
    """Generalised forces of effects on (x, y, theta), platform axes."""
    return ca.vertcat(wrench[0], wrench[1], wrench[5] + ca.sum1(pivot))


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
    m.output(qs.X, motion.x)
    m.output(qs.Y, motion.y)
    m.output(qs.THETA, motion.theta)
    m.output(qs.X_RATE, motion.rates[0])
    m.output(qs.Y_RATE, motion.rates[1])
    m.output(qs.THETA_RATE, motion.rates[2])
    m.output(qs.BETA, motion.beta)
    m.output(qs.PHI, motion.phi)
    m.output(qs.BETA_RATE, beta_rate)
    m.output(qs.PHI_RATE, phi_rate)
