"""What all fidelities of the crawler do alike: read the track speeds, integrate the pose."""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from .. import crawler as qs
from ..laws.planar_frame import rotated
from ..model import SX, Model

YAW_RATE_FLOOR = 1e-5
"""Yaw rate [rad/s] below which e2, e3 (infinite for straight driving with slip) fade to 0."""


class Speeds(NamedTuple):
    """Speeds of the track wheels [rad/s]: as fed to the port, and as the tracks run."""

    w2_in: SX
    w3_in: SX
    w2: SX
    w3: SX


def track_speeds(m: Model) -> Speeds:
    """Declare the inputs and let effects change the speed at which each track runs."""
    u = m.inputs(qs.W2, qs.W3)
    left = m.balance("speed_left", "signal", unit="rad/s", value=u.w3)
    right = m.balance("speed_right", "signal", unit="rad/s", value=u.w2)
    return Speeds(u.w2, u.w3, u.w2 + right.effort, u.w3 + left.effort)


class Pose(NamedTuple):
    """Pose of the body frame in the world."""

    x: SX
    y: SX
    beta: SX


def pose_states(m: Model) -> Pose:
    """Declare the pose; its start values are the initial pose."""
    x = m.states(qs.POSE_X, qs.POSE_Y, qs.POSE_BETA)
    return Pose(x.pose_x, x.pose_y, x.pose_beta)


def integrate_pose(m: Model, pose: Pose, v_x: SX, v_y: SX, w_z: SX) -> None:
    """Set the derivatives of the pose and output it, with the speeds and point S.

    x' = v_x cos beta - v_y sin beta,  y' = v_x sin beta + v_y cos beta,  beta' = w_z
    x_S = x - l_Sx cos beta + l_Sy sin beta,  y_S = y - l_Sx sin beta - l_Sy cos beta
    """
    p = m.parameters(qs.L_SX, qs.L_SY)
    x_dot, y_dot = rotated(pose.beta, v_x, v_y)
    s_x, s_y = rotated(pose.beta, -p.l_Sx, -p.l_Sy)
    m.derivative(pose.x, x_dot)
    m.derivative(pose.y, y_dot)
    m.derivative(pose.beta, w_z)
    m.output(qs.X, pose.x)
    m.output(qs.Y, pose.y)
    m.output(qs.BETA, pose.beta)
    m.output(qs.V, v_x)
    m.output(qs.W_Z, w_z)
    m.output(qs.X_S, pose.x + s_x)
    m.output(qs.Y_S, pose.y + s_y)


def virtual_wheels(r: SX, track: SX, speeds: Speeds, v_x: SX, w_z: SX) -> tuple[SX, SX]:
    """e2 = (r w2 - v)/w_z - B/2,  e3 = (v - r w3)/w_z - B/2; 0 at w_z = 0."""
    inverse = w_z / (w_z**2 + YAW_RATE_FLOOR**2)
    e2 = (r * speeds.w2 - v_x - track / 2 * w_z) * inverse
    e3 = (v_x - r * speeds.w3 - track / 2 * w_z) * inverse
    return e2, e3


def two_wheel_motion(r: SX, track: SX, e2: SX, e3: SX, speeds: Speeds) -> tuple[SX, SX]:
    """Speed of O1 and yaw rate of two virtual wheels that roll without slip.

    w_z = r (w2 - w3)/(B + e2 + e3),  v = r ((B/2 + e3) w2 + (B/2 + e2) w3)/(B + e2 + e3)
    """
    span = track + e2 + e3
    w_z = r * (speeds.w2 - speeds.w3) / span
    v_x = r * ((track / 2 + e3) * speeds.w2 + (track / 2 + e2) * speeds.w3) / span
    return v_x, w_z


def output_kinematic(m: Model, speeds: Speeds, e2: SX, e3: SX) -> None:
    """Output e2, e3 and the ports of a fidelity without forces: torques and powers are 0."""
    m.output(qs.E2, e2)
    m.output(qs.E3, e3)
    zero = ca.SX(0)
    m.port(qs.SPROCKET_RIGHT, m.output(qs.TAU2, zero), speeds.w2_in)
    m.port(qs.SPROCKET_LEFT, m.output(qs.TAU3, zero), speeds.w3_in)
