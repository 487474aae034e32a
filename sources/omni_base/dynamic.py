"""Rigid platform and wheel sets whose wheels do not slip; constraints eliminated.

    M xi'' + h = S^T Gamma,   M = S^T T S,  h = S^T (T S' xi' + C X'),   X = (xi, beta, phi)
    beta' = -(1/e) C1 R xi',  phi' = -(1/r) J1 R xi',   X' = S xi',  xi = (x, y, theta)

T is the inertia matrix of platform and wheel sets, C X' their velocity forces
(`rigid_body.py`). Gamma is what acts on the axles: motors, friction f_s tanh(q'/w_0) + f_v q',
effects; a pivot torque of a contact patch acts on steering angle and yaw alike. Energy is kept by
construction.

Not modelled: slip, tyre deformation, load transfer between the wheels (each carries a third of the
weight), motors and gears, steering stops, inclination of the floor in the steering torques.

Source: omnidirectional base paper, Eq 20 to 34 and 45 to 48 (Eq 47 and 48 corrected, see README).
"""

from __future__ import annotations

from ..component import Fidelity, Solver
from ..laws import symmetric
from ..model import Model
from .platform import finish, forces, geometry, motion_states
from .rigid_body import joint_map, kinetic_energy, reduced

FIDELITY = Fidelity(level=1, solver=Solver("rodas3", 1e-3))


def equations(m: Model) -> None:
    """Collect the equations."""
    motion = motion_states(m)
    g = geometry(m)
    k_beta, k_phi = joint_map(g, motion.beta)
    beta_rate, phi_rate = k_beta @ motion.u, k_phi @ motion.u
    masses, acting = forces(m, g, motion, beta_rate, phi_rate)
    mass, bias = reduced(g, masses, motion.beta, motion.u, beta_rate)
    force = acting.pose + k_beta.T @ acting.beta + k_phi.T @ acting.phi
    finish(m, motion, symmetric.solve(mass, force - bias), beta_rate, phi_rate)
    m.stored_energy(kinetic_energy(g, masses, motion.beta, motion.u, beta_rate, phi_rate))
