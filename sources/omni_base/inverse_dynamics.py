"""Torques of the six motors for a wanted acceleration of the platform, least in the sum of squares.

    Gamma = W (W^T W)^-1 (M R xi'' + h) + f_s tanh(q'/w_0) + f_v q',   W = [K_beta; K_phi]

Six motors for three degrees of freedom leave a space of dimension 3 in which the axles fight each
other; the minimum norm has no part in it. Friction is compensated axle by axle.

Source: omnidirectional base paper, inverse dynamics with all joints motorised.
"""

from __future__ import annotations

import casadi as ca

from ..laws import symmetric
from ..model import SX
from .rigid_body import Geometry, Masses, joint_map, reduced, rotation


def motor_torques(
    g: Geometry,
    masses: Masses,
    theta: SX,
    beta: SX,
    rates: SX,
    acceleration: SX,
    friction: tuple[SX, SX, SX] = (0, 0, 1),
) -> tuple[SX, SX]:
    """Steering and rolling torques (3 each) for rates xi' and acceleration xi'' in the world.

    Args:
        g, masses: the base.
        theta, beta: heading and steering angles.
        rates, acceleration: xi' and xi'' (3 each).
        friction: f_s [N.m], f_v [N.m.s/rad] and w_0 [rad/s] of the axles.
    """
    to_platform = rotation(theta)
    u = to_platform @ rates
    k_beta, k_phi = joint_map(g, beta)
    beta_rate, phi_rate = k_beta @ u, k_phi @ u
    mass, bias = reduced(g, masses, beta, u, beta_rate)
    force = mass @ (to_platform @ acceleration) + bias
    share = symmetric.solve(k_beta.T @ k_beta + k_phi.T @ k_phi, force)
    f_s, f_v, w_0 = friction
    tau_beta = k_beta @ share + f_s * ca.tanh(beta_rate / w_0) + f_v * beta_rate
    tau_phi = k_phi @ share + f_s * ca.tanh(phi_rate / w_0) + f_v * phi_rate
    return tau_beta, tau_phi
