"""Rigid platform and wheel sets on wheels that creep in proportion to load and creepage.

    T X'' + C X' = Gamma + A^T f,   X = (x, y, theta, beta, phi)
    s_x = J1_i R xi' + r phi',   s_y = C1_i R xi' + e beta'   (slip along and across the heading)
    p = -N (c_x s_x, c_y s_y)/V,   V = sqrt((r phi')^2 + v_0^2)
    f = p tanh(a)/a,   a = |p|/(mu N)
    sum N_i = W,   sum N_i C_i = W r_G   (level floor, no load transfer by acceleration; N_i >= 0)
    axles: -b_s beta',   -b_d phi' - f_r N r tanh(phi'/w_r)

T has the rotors of the steering motors, J_beta, on beta'' alone; what the rotors of the rolling
motors add at the wheels belongs to I_phi. r_G is the mass centre of platform and wheel sets, which
moves with the steering angles, C_i are the contact points.

Not modelled: load transfer by acceleration, the steering rotors' share in the yaw momentum, tyre
relaxation, stiction.

Source: omnidirectional base paper, Eq 20 to 31 (dynamics); linear creep e.g. Kalker,
Three-Dimensional Elastic Bodies in Rolling Contact, 1990; laws of contact and axles from the rig
sheet omni_bench.
"""

from __future__ import annotations

import casadi as ca

from .. import omni_base as qs
from ..component import Fidelity, Solver
from ..laws import contact, symmetric
from ..laws.planar_frame import rotated
from ..model import SX, Model
from ..quantity import Quantity
from . import platform as base
from .rigid_body import (
    inertia_blocks,
    kinetic_energy,
    lateral_rows,
    rolling_rows,
    velocity_forces,
)
from .slip import ROLLING_RATE, SLIP_ACROSS, SLIP_ALONG, STEERING_RATE

# Near standstill the contact has time constants of 30 us: implicit, and L-stable.
FIDELITY = Fidelity(level=3, solver=Solver("rodas3", 1e-3))

B_D = Quantity("b_d", "N.m.s/rad", "viscous friction of each rolling axle", 0.6, minimum=0.0)
B_S = Quantity("b_s", "N.m.s/rad", "viscous friction of each steering axle", 0.8, minimum=0.0)
J_BETA = Quantity(
    "J_beta", "kg.m2", "inertia of a steering motor's rotor, seen from the fork", 0.096, minimum=0.0
)
F_R = Quantity("f_r", "1", "rolling resistance over load", start=0.012, minimum=0.0)
W_R = Quantity(
    "w_r", "rad/s", "spin rate over which rolling resistance changes sign", 0.1, minimum=1e-4
)
C_X = Quantity("c_x", "1", "force over load and creepage along the heading", 12.0, minimum=1e-3)
C_Y = Quantity("c_y", "1", "force over load and creepage across the heading", 9.0, minimum=1e-3)
MU = Quantity("mu", "1", "friction coefficient on the floor", start=0.6, minimum=1e-3)
NORMAL = Quantity("normal", "N", "loads of the wheels", size=3, nominal=800.0)
V_0 = Quantity("v_0", "m/s", "rolling speed that counts as standstill", start=0.05, minimum=1e-5)


def equations(m: Model) -> None:
    """Collect the equations."""
    x = m.states(ROLLING_RATE, STEERING_RATE)
    motion = base.motion_states(m)
    beta_rate, phi_rate = x.steering_rate, x.rolling_rate
    u = m.inputs(qs.TAU_BETA, qs.TAU_PHI)
    declared = base.geometry(m)
    radius = each(m, "radius", "coefficient", "m", value=declared.r, angle=motion.phi)
    g = declared._replace(r=declared.r + radius)
    p = m.parameters(
        base.M_P, base.M_W, base.D, base.I_P, base.I_S, base.I_PHI, base.X_G, base.Y_G,
        base.GRAVITY, J_BETA, B_D, B_S, F_R, W_R, C_X, C_Y, MU, V_0,
    )  # fmt: skip
    body = base.bodies(m, g, motion, p, beta_rate)
    masses = body.masses
    contact_x = g.x - g.e * ca.cos(motion.beta)
    contact_y = g.y - g.e * ca.sin(motion.beta)
    normal = m.output(NORMAL, ca.fmax(loads(body, contact_x, contact_y), 0))

    j1, c1 = rolling_rows(g, motion.beta), lateral_rows(g, motion.beta)
    along = m.output(SLIP_ALONG, j1 @ motion.u + g.r * phi_rate)
    across = m.output(SLIP_ACROSS, c1 @ motion.u + g.e * beta_rate)
    d_x, d_y = rotated(motion.theta, contact_x, contact_y)
    patch = m.balance(
        "mu",
        "coefficient",
        unit="1",
        value=ca.repmat(p.mu, 3),
        x=motion.x + d_x,
        y=motion.y + d_y,
    )
    speed = ca.sqrt((g.r * phi_rate) ** 2 + p.v_0**2)
    limit = (p.mu + patch.effort) * normal
    f_along, f_across = contact.creepage(along, across, speed, p.c_x, p.c_y, normal, limit)
    m.loss("slip", -ca.dot(f_along, along) - ca.dot(f_across, across))

    resistance = contact.rolling_resistance(p.f_r, normal, g.r, phi_rate, p.w_r)
    m.loss("rolling", ca.dot(resistance, phi_rate))
    m.loss("axles", p.b_s * ca.sumsqr(beta_rate) + p.b_d * ca.sumsqr(phi_rate))
    steering = each(
        m, "steering", "rotation", velocity=beta_rate, angle=motion.beta, load=u.tau_beta
    )
    rolling = each(
        m, "rolling", "rotation", velocity=phi_rate, angle=motion.phi, load=u.tau_phi,
        normal=normal, radius=g.r,
    )  # fmt: skip
    m.port(qs.STEERING, u.tau_beta, beta_rate)
    m.port(qs.ROLLING, u.tau_phi, phi_rate)
    pivot = each(
        m, "pivot", "pivot", **base.pivot_signals(g.r, motion, beta_rate, phi_rate, normal)
    )

    f, coupling = inertia_blocks(g, masses, motion.beta)
    h_pose, h_beta = velocity_forces(g, masses, motion.beta, motion.u[2], beta_rate)
    i_beta = masses.i_beta + p.J_beta
    on_pose = base.on_pose(body.wrench, pivot) + j1.T @ f_along + c1.T @ f_across - h_pose
    on_beta = u.tau_beta - p.b_s * beta_rate + steering + pivot + body.forks
    on_beta = on_beta + g.e * f_across - h_beta
    on_phi = u.tau_phi - p.b_d * phi_rate - resistance + rolling + g.r * f_along
    # beta'' eliminated: (F - G G^T/I_beta) a = Q_pose - G Q_beta/I_beta
    acceleration = symmetric.solve(
        f - coupling @ coupling.T / i_beta, on_pose - coupling @ on_beta / i_beta
    )
    m.derivative(beta_rate, (on_beta - coupling.T @ acceleration) / i_beta)
    m.derivative(phi_rate, on_phi / masses.i_phi)
    base.finish(m, motion, acceleration, beta_rate, phi_rate)
    energy = kinetic_energy(g, masses, motion.beta, motion.u, beta_rate, phi_rate)
    m.stored_energy(energy + p.J_beta * ca.sumsqr(beta_rate) / 2)


def each(m: Model, name: str, kind: str, unit: str = "", **signals: SX) -> SX:
    """Open a balance for all three wheels and one for each; what effects add to them."""
    together = m.balance(name, kind, unit=unit, **signals)
    single = [
        m.balance(
            f"{name}_{i + 1}", kind, unit=unit, **{key: value[i] for key, value in signals.items()}
        ).effort
        for i in range(3)
    ]
    return together.effort + ca.vertcat(*single)


def loads(body: base.Bodies, x: SX, y: SX) -> SX:
    """Normal forces from the equilibrium of the whole weight on the contact points (x, y).

    Each wheel carries the share of the triangle that the mass centre spans with the other two.
    """
    masses = body.masses
    mass = masses.mass + 3 * masses.m_w
    c_x, c_y = body.moment[0] / mass, body.moment[1] / mass

    def area(i: int, j: int, p_x: SX, p_y: SX) -> SX:
        return (x[i] - p_x) * (y[j] - p_y) - (x[j] - p_x) * (y[i] - p_y)

    whole = area(0, 1, x[2], y[2])
    shares = ca.vertcat(area(1, 2, c_x, c_y), area(2, 0, c_x, c_y), area(0, 1, c_x, c_y))
    return body.weight * shares / whole
