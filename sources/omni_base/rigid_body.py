"""Kinematics and inertia of the platform with its three wheel sets, in platform axes.

Wheel i steers about A_i = l (cos alpha_i, sin alpha_i); t_i = (cos beta_i, sin beta_i) is its
heading; it touches the floor at C_i = A_i - e_i t_i. With u = (u_x, u_y, theta'), the velocity of
the reference point in platform axes and the yaw rate:

    rolling   J1 u + r phi' = 0,   J1_i = (cos b,  sin b, x_i sin b - y_i cos b),        b = beta_i
    no slip   C1 u + e beta' = 0,  C1_i = (sin b, -cos b, e_i - x_i cos b - y_i sin b)

The platform has mass, first moment and inertia about the reference point; a wheel set (fork and
wheel) has mass m_w at A_i - d t_i, yaw inertia I_s about it and spin inertia I_phi.

Source: omnidirectional base paper, Eq 2, 14 to 16, 20 to 31 (corrected, see README).
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from ..model import SX


class Geometry(NamedTuple):
    """Steering axes (3 each) [m], caster offset (3) [m] and wheel radius (3) [m]."""

    x: SX
    y: SX
    e: SX
    r: SX


class Masses(NamedTuple):
    """Inertia of the platform about the reference point, and of one wheel set.

    Attributes:
        mass, s_x, s_y, inertia: platform [kg], [kg.m], [kg.m2].
        m_w, d, i_s, i_phi: wheel set's mass [kg], distance of its mass centre behind the steering
            axis [m], yaw inertia about it and spin inertia [kg.m2].
    """

    mass: SX
    s_x: SX
    s_y: SX
    inertia: SX
    m_w: SX
    d: SX
    i_s: SX
    i_phi: SX

    @property
    def i_beta(self) -> SX:
        """Yaw inertia of a wheel set about its steering axis."""
        return self.i_s + self.m_w * self.d**2


def rotation(theta: SX) -> SX:
    """R: world rates (x', y', theta') to platform axes."""
    c, s = ca.cos(theta), ca.sin(theta)
    return ca.vertcat(ca.horzcat(c, s, 0), ca.horzcat(-s, c, 0), ca.horzcat(0, 0, 1))


def rolling_rows(g: Geometry, beta: SX) -> SX:
    """J1 (3x3)."""
    c, s = ca.cos(beta), ca.sin(beta)
    return ca.horzcat(c, s, g.x * s - g.y * c)


def lateral_rows(g: Geometry, beta: SX) -> SX:
    """C1 (3x3)."""
    c, s = ca.cos(beta), ca.sin(beta)
    return ca.horzcat(s, -c, g.e - g.x * c - g.y * s)


def joint_map(g: Geometry, beta: SX) -> tuple[SX, SX]:
    """K_beta, K_phi (3x3 each): beta' = K_beta u, phi' = K_phi u without slip."""
    steering = -lateral_rows(g, beta) / ca.repmat(g.e, 1, 3)
    rolling = -rolling_rows(g, beta) / ca.repmat(g.r, 1, 3)
    return steering, rolling


def joint_bias(g: Geometry, beta: SX, u: SX, beta_rate: SX) -> tuple[SX, SX]:
    """Joint accelerations without slip at x'' = y'' = theta'' = 0 (world axes)."""
    c, s = ca.cos(beta), ca.sin(beta)
    turn, cross = beta_rate + u[2], beta_rate * u[2]
    steering = turn * (c * u[0] + s * u[1]) + cross * (g.x * s - g.y * c)
    rolling = turn * (c * u[1] - s * u[0]) + cross * (g.x * c + g.y * s)
    return -steering / g.e, -rolling / g.r


def inertia_blocks(g: Geometry, masses: Masses, beta: SX) -> tuple[SX, SX]:
    """F (3x3) and G (3x3) of the inertia matrix [F G 0; G^T I_beta 0; 0 0 I_phi]."""
    c, s = ca.cos(beta), ca.sin(beta)
    m_w, d = masses.m_w, masses.d
    x, y = g.x - d * c, g.y - d * s  # mass centres of the wheel sets
    total = masses.mass + 3 * m_w
    f13 = -masses.s_y - m_w * ca.sum1(y)
    f23 = masses.s_x + m_w * ca.sum1(x)
    f33 = masses.inertia + 3 * masses.i_s + m_w * (ca.sumsqr(x) + ca.sumsqr(y))
    f = ca.vertcat(ca.horzcat(total, 0, f13), ca.horzcat(0, total, f23), ca.horzcat(f13, f23, f33))
    lever = masses.i_s + m_w * (d**2 - d * (g.x * c + g.y * s))
    return f, ca.horzcat(m_w * d * s, -m_w * d * c, lever).T


def velocity_forces(
    g: Geometry, masses: Masses, beta: SX, rate: SX, beta_rate: SX
) -> tuple[SX, SX]:
    """h: generalised forces of the velocity products on (x, y, theta), platform axes, and beta."""
    c, s = ca.cos(beta), ca.sin(beta)
    md = masses.m_w * masses.d
    turn = (rate + beta_rate) ** 2
    m_w = masses.m_w
    force_x = -(rate**2) * (masses.s_x + m_w * ca.sum1(g.x)) + md * ca.dot(turn, c)
    force_y = -(rate**2) * (masses.s_y + m_w * ca.sum1(g.y)) + md * ca.dot(turn, s)
    moment = md * ca.dot(turn - rate**2, g.x * s - g.y * c)
    return ca.vertcat(force_x, force_y, moment), md * rate**2 * (g.y * c - g.x * s)


def reduced(g: Geometry, masses: Masses, beta: SX, u: SX, beta_rate: SX) -> tuple[SX, SX]:
    """M and h of the motion without slip, M R xi'' + h = generalised forces (platform axes)."""
    k_beta, k_phi = joint_map(g, beta)
    b_beta, b_phi = joint_bias(g, beta, u, beta_rate)
    f, coupling = inertia_blocks(g, masses, beta)
    h_pose, h_beta = velocity_forces(g, masses, beta, u[2], beta_rate)
    i_beta, i_phi = masses.i_beta, masses.i_phi
    mixed = coupling @ k_beta
    mass = f + mixed + mixed.T + i_beta * k_beta.T @ k_beta + i_phi * k_phi.T @ k_phi
    bias = (
        coupling @ b_beta + k_beta.T @ (i_beta * b_beta + h_beta) + i_phi * k_phi.T @ b_phi + h_pose
    )
    return mass, bias


def kinetic_energy(g: Geometry, masses: Masses, beta: SX, u: SX, beta_rate: SX, phi_rate: SX) -> SX:
    """Kinetic energy [J]."""
    f, coupling = inertia_blocks(g, masses, beta)
    pose = ca.dot(u, f @ u) / 2 + ca.dot(u, coupling @ beta_rate)
    return pose + masses.i_beta * ca.sumsqr(beta_rate) / 2 + masses.i_phi * ca.sumsqr(phi_rate) / 2


def mean_inertia(g: Geometry, masses: Masses) -> tuple[SX, SX]:
    """Mean over all steering angles of the diagonal of M: mass [kg] and yaw inertia [kg.m2]."""
    i_beta, i_phi, md = masses.i_beta, masses.i_phi, masses.m_w * masses.d
    square = g.x**2 + g.y**2
    mass = (
        masses.mass
        + 3 * masses.m_w
        + ca.sum1(i_phi / (2 * g.r**2) + i_beta / (2 * g.e**2) - md / g.e)
    )
    yaw = masses.inertia + ca.sum1(
        i_beta * (square / (2 * g.e**2))
        + masses.m_w * square
        - md * square / g.e
        + i_phi * square / (2 * g.r**2)
    )
    return mass, yaw
