"""Wheels that do not slip under a platform of constant, decoupled inertia.

    R(theta)^T diag(m_0, m_0, I_0) R(theta) xi'' = S^T Gamma,   xi = (x, y, theta)
    beta' = -(1/e) C1 R xi',  phi' = -(1/r) J1 R xi',  S = [1; -(1/e) C1 R; -(1/r) J1 R]

m_0 and I_0 are the means over all steering angles of the diagonal of the true M(theta, beta) of
`dynamic`; its off-diagonal terms and the velocity forces are left out, so that torques act on a
free mass through the exact kinematics. Gamma is what acts on the axles (motors, friction, effects).

Not modelled: coupling between the axes of motion, velocity forces, the dependence of the inertia on
the steering angles, slip, load transfer.

Source: omnidirectional base paper, Eq 15 and 16 (kinematics); the averaging is derived in README.
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity, Solver
from ..model import Model
from .platform import finish, forces, geometry, motion_states
from .rigid_body import joint_map, mean_inertia

FIDELITY = Fidelity(level=0, solver=Solver("rodas3", 1e-3))


def equations(m: Model) -> None:
    """Collect the equations."""
    motion = motion_states(m)
    g = geometry(m)
    k_beta, k_phi = joint_map(g, motion.beta)
    beta_rate, phi_rate = k_beta @ motion.u, k_phi @ motion.u
    masses, acting = forces(m, g, motion, beta_rate, phi_rate)
    mass, yaw = mean_inertia(g, masses)
    force = acting.pose + k_beta.T @ acting.beta + k_phi.T @ acting.phi
    finish(m, motion, force / ca.vertcat(mass, mass, yaw), beta_rate, phi_rate)
    m.stored_energy((mass * ca.sumsqr(motion.u[:2]) + yaw * motion.u[2] ** 2) / 2)
