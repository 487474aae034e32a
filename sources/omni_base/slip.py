"""Rigid platform and wheel sets on wheels that slip, with a contact force for each wheel.

    T X'' + C X' = Gamma + A^T f,   X = (x, y, theta, beta, phi)
    slip velocity of wheel i: along its heading J1_i R xi' + r phi', across it C1_i R xi' + e beta'
    f_i = -mu(|s_i|) N s_i/|s_i|  (smooth stick-slip, `laws/contact.py`)

The nine velocities are states; the rows of A are those of the two slip velocities. `dynamic` is the
limit of small `v_c`: a held force F makes a wheel creep at F v_c/(1.5 mu_s N).

Not modelled: tyre deformation and relaxation, load transfer between the wheels (each carries a
third of the weight), true sticking.

Source: omnidirectional base paper, Eq 20 to 31 (dynamics); smooth stick-slip friction in the manner
of MathWorks' Spatial Contact Force block.
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity, Solver
from ..laws import symmetric
from ..laws.contact import stick_slip
from ..laws.planar_frame import rotated
from ..model import Model
from ..quantity import Quantity
from .platform import finish, forces, geometry, motion_states
from .rigid_body import (
    inertia_blocks,
    kinetic_energy,
    lateral_rows,
    rolling_rows,
    velocity_forces,
)

FIDELITY = Fidelity(level=2, solver=Solver("rodas3_adaptive", 5e-3, 1e-6))

MU_S = Quantity("mu_s", "1", "static friction coefficient on the floor", start=0.35, minimum=1e-3)
MU_D = Quantity("mu_d", "1", "sliding friction coefficient on the floor", start=0.35, minimum=0.0)
V_C = Quantity(
    "v_c", "m/s", "slip velocity at which friction is greatest", start=5e-3, minimum=1e-5
)
STEERING_RATE = Quantity("steering_rate", "rad/s", "state behind betad", size=3)
ROLLING_RATE = Quantity("rolling_rate", "rad/s", "state behind phid", size=3)
SLIP_ALONG = Quantity("slip_along", "m/s", "slip velocities along the wheels' headings", size=3)
SLIP_ACROSS = Quantity("slip_across", "m/s", "slip velocities across the wheels' headings", size=3)


def equations(m: Model) -> None:
    """Collect the equations."""
    x = m.states(ROLLING_RATE, STEERING_RATE)
    motion = motion_states(m)
    g = geometry(m)
    masses, acting = forces(m, g, motion, x.steering_rate, x.rolling_rate)
    p = m.parameters(MU_S, MU_D, V_C)

    j1, c1 = rolling_rows(g, motion.beta), lateral_rows(g, motion.beta)
    along = m.output(SLIP_ALONG, j1 @ motion.u + g.r * x.rolling_rate)
    across = m.output(SLIP_ACROSS, c1 @ motion.u + g.e * x.steering_rate)
    d_x, d_y = rotated(
        motion.theta, g.x - g.e * ca.cos(motion.beta), g.y - g.e * ca.sin(motion.beta)
    )
    patch = m.balance(
        "mu",
        "coefficient",
        unit="1",
        value=ca.repmat(p.mu_s, 3),
        x=motion.x + d_x,
        y=motion.y + d_y,
    )
    share = 1 + patch.effort / p.mu_s
    f_along, f_across = stick_slip(along, across, acting.normal * share, p.mu_s, p.mu_d, p.v_c)
    m.loss("slip", -ca.dot(f_along, along) - ca.dot(f_across, across))

    f, coupling = inertia_blocks(g, masses, motion.beta)
    h_pose, h_beta = velocity_forces(g, masses, motion.beta, motion.u[2], x.steering_rate)
    i_beta = masses.i_beta
    on_pose = acting.pose + j1.T @ f_along + c1.T @ f_across - h_pose
    on_beta = acting.beta + g.e * f_across - h_beta
    on_phi = acting.phi + g.r * f_along
    # beta'' eliminated: (F - G G^T/I_beta) a = Q_pose - G Q_beta/I_beta
    acceleration = symmetric.solve(
        f - coupling @ coupling.T / i_beta, on_pose - coupling @ on_beta / i_beta
    )
    m.derivative(x.steering_rate, (on_beta - coupling.T @ acceleration) / i_beta)
    m.derivative(x.rolling_rate, on_phi / masses.i_phi)
    finish(m, motion, acceleration, x.steering_rate, x.rolling_rate)
    m.stored_energy(
        kinetic_energy(g, masses, motion.beta, motion.u, x.steering_rate, x.rolling_rate)
    )
