"""Rigid body on two tracks whose road wheels press on the floor and slide with Coulomb friction.

Road wheel i of a track lies at (x_i, y_t), y_t = -B/2 (right) or +B/2 (left), x_i equally spaced
from -a to a. Its ground point slides with u, the floor answers with f:

    u = (v_x - y_t w_z - r w_t,  v_y + x_i w_z),   f = -N_i (mu u_x, mu_lat u_y)/max(|u|, u_0)

(linear below u_0). A track that stands askew (its `toe` about its middle, an effect's) has these
in axes of its own: its road wheels lie along it, its belt moves along it. The loads N_i carry the
weight and what effects add, quasi-statically and linear in x and y over the road wheels:

    N_i = P/(2n) + x_i T_x/(2 sum x_i^2) + y_t T_y/(2n (B/2)^2)
    P = m g - F_z,  T_x = m g x_G + M_y,  T_y = m g y_G - M_x

The body obeys planar Newton-Euler equations about O1 (`laws/planar_body.py`), driven by the sum of
f, rolling resistance -f_r N_i tanh(v_t/v_r) along each track (v_t = v_x - y_t w_z) and effects. The
tracks have no mass and run at r w_t: the sprockets need tau2 = r sum f_x (right), tau3 (left).

O1 is the middle of the contact rectangle. e2, e3 are the shifts that a two-wheeled model would need
for the present motion; the rotation centres lie on the line x = x_V = -v_y/w_z.

Not modelled: load transfer by acceleration, suspension, belt tension and slip on the sprocket, soft
ground, unequal spacing of road wheels, lifting (a road wheel whose load would be negative carries
none, the others do not take over).

Source: Coulomb friction under a rigid track, e.g. Wong, Theory of Ground Vehicles, ch. 6 (skid
steering); quasi-static formulas in README.
"""

from __future__ import annotations

import casadi as ca

from .. import crawler as qs
from ..component import Fidelity, Solver
from ..laws import planar_body
from ..laws.planar_frame import rotated
from ..model import SX, Model
from ..quantity import Quantity
from .pose import (
    YAW_RATE_FLOOR,
    Pose,
    integrate_pose,
    pose_states,
    track_speeds,
    virtual_wheels,
)

FIDELITY = Fidelity(level=2, solver=Solver("rodas3_adaptive", 0.02, 1e-6))
"""Friction at rest decays within 0.2 ms; only the error-controlled solver steps over it cheaply."""

A = Quantity(
    "a", "m", "half length of the ground contact, first to last road wheel", start=0.1, minimum=1e-3
)
MU = Quantity("mu", "1", "friction coefficient of track on floor", start=0.6, minimum=0.0)
MASS = Quantity("mass", "kg", "mass of the vehicle", start=20.0, minimum=0.1, nominal=10.0)
YAW_INERTIA = Quantity(
    "yaw_inertia", "kg.m2", "yaw inertia about the mass centre", start=0.5, minimum=1e-3
)
X_G = Quantity("x_G", "m", "mass centre in front of O1", nominal=0.01)
Y_G = Quantity("y_G", "m", "mass centre to the left of O1", nominal=0.01)
Z_G = Quantity("z_G", "m", "height of the mass centre over the floor", start=0.1, nominal=0.1)
F_R = Quantity("f_r", "1", "rolling resistance coefficient", minimum=0.0, nominal=0.01)
GRAVITY = Quantity("gravity", "m/s2", "gravity", start=9.81, minimum=0.0)
U_0 = Quantity(
    "u_0", "m/s", "sliding speed below which friction is linear", start=1e-3, minimum=1e-6
)
V_R = Quantity(
    "v_r", "m/s", "speed over which the rolling resistance changes sign", start=5e-3, minimum=1e-6
)
VEL_X = Quantity("vel_x", "m/s", "speed of O1 along body x, the state behind v", nominal=0.1)
VEL_Y = Quantity("vel_y", "m/s", "speed of O1 along body y, the state behind v_y", nominal=0.1)
YAW_RATE = Quantity("yaw_rate", "rad/s", "yaw rate, the state behind w_z", nominal=0.1)

V_Y = Quantity("v_y", "m/s", "speed of O1 along the body y axis")
X_AXIS = Quantity("x_axis", "m", "distance of the present rotation centres in front of O1")


def equations(m: Model) -> None:
    """Collect the equations."""
    speeds = track_speeds(m)
    pose = pose_states(m)
    p = m.parameters(qs.R, qs.B, A, MASS, YAW_INERTIA, MU, X_G, Y_G, Z_G, GRAVITY, F_R, U_0, V_R)
    x = m.states(VEL_X, VEL_Y, YAW_RATE)
    v_x, v_y, w_z = x.vel_x, x.vel_y, x.yaw_rate
    count = int(m.constant("road_wheels"))

    # Road wheels: the right track's first, then the left track's.
    spacing = ca.DM([2 * i / (count - 1) - 1 for i in range(count)])
    along = ca.vertcat(spacing, spacing) * p.a
    side = ca.vertcat(-ca.DM.ones(count), ca.DM.ones(count))
    across = side * p.B / 2
    r2, r3 = (
        p.r + m.balance(name, "coefficient", unit="m", value=p.r, turning=w).effort
        for name, w in (("radius_right", speeds.w2), ("radius_left", speeds.w3))
    )
    belt = ca.vertcat(ca.repmat(r2 * speeds.w2, count), ca.repmat(r3 * speeds.w3, count))
    toe: SX = ca.vertcat(
        *(
            ca.repmat(m.balance(name, "coefficient", unit="rad", value=0).effort, count)
            for name in ("toe_right", "toe_left")
        )
    )

    load = m.balance("load", "position", value=ca.vertcat(p.x_G, p.y_G, p.z_G))
    centre = ca.vertcat(p.x_G, p.y_G, p.z_G) + load.effort
    cos, sin = ca.cos(pose.beta), ca.sin(pose.beta)
    body = m.balance(
        "body",
        "body",
        velocity=ca.vertcat(v_x, v_y, 0),
        rate=ca.vertcat(0, 0, w_z),
        gravity=ca.vertcat(0, 0, -p.gravity),
        position=ca.vertcat(pose.x, pose.y, 0),
        rotation=ca.vertcat(ca.horzcat(cos, -sin, 0), ca.horzcat(sin, cos, 0), ca.horzcat(0, 0, 1)),
        mass=p.mass,
        first_moment=p.mass * centre,
    )
    total = p.mass + body.mass
    first = p.mass * centre + body.first_moment
    about_origin = p.yaw_inertia + p.mass * (centre[0] ** 2 + centre[1] ** 2) + body.inertia[2, 2]

    normal = _loads(
        p.gravity * total - body.effort[2],
        p.gravity * first[0] + body.effort[4],
        p.gravity * first[1] - body.effort[3],
        along,
        across,
        count,
    )
    # in the axes of each track, which stand askew by its toe about its middle
    ahead, beside = along * ca.cos(toe), across + along * ca.sin(toe)
    forward, slide_y = _turned(toe, v_x - beside * w_z, v_y + ahead * w_z)
    slide_x = forward - belt
    sliding = ca.sqrt(slide_x**2 + slide_y**2 + 1e-24)  # the floor keeps the slope at rest
    mu_long, mu_lat = _friction(m, p.mu, side, pose, ahead, beside, sliding)
    scale = normal / ca.fmax(sliding, p.u_0)
    grip, across_grip = -mu_long * scale * slide_x, -mu_lat * scale * slide_y
    rolling = -p.f_r * normal * ca.tanh(forward / p.v_r)
    f_x, f_y = _turned(-toe, grip + rolling, across_grip)
    pivot = m.balance(
        "pivot", "pivot", spin=w_z, rolling=ca.sqrt(v_x**2 + 1e-12), normal=ca.sum1(normal)
    )

    a_x, a_y, w_dot = planar_body.accelerations(
        total,
        first[0],
        first[1],
        about_origin,
        ca.sum1(f_x) + body.effort[0],
        ca.sum1(f_y) + body.effort[1],
        ca.dot(ahead, f_y) - ca.dot(beside, f_x) + body.effort[5] + pivot.effort,
        w_z,
    )
    m.derivative(v_x, a_x + w_z * v_y)
    m.derivative(v_y, a_y - w_z * v_x)
    m.derivative(w_z, w_dot)
    integrate_pose(m, pose, v_x, v_y, w_z)
    e2, e3 = virtual_wheels(p.r, p.B, speeds, v_x, w_z)
    m.output(qs.E2, e2)
    m.output(qs.E3, e3)
    m.output(V_Y, v_y)
    m.output(X_AXIS, -v_y * w_z / (w_z**2 + YAW_RATE_FLOOR**2))

    pull2, pull3 = r2 * ca.sum1(grip[:count]), r3 * ca.sum1(grip[count:])
    right = m.balance("sprocket_right", "rotation", velocity=speeds.w2_in, load=pull2)
    left = m.balance("sprocket_left", "rotation", velocity=speeds.w3_in, load=pull3)
    m.port(qs.SPROCKET_RIGHT, m.output(qs.TAU2, pull2 - right.effort), speeds.w2_in)
    m.port(qs.SPROCKET_LEFT, m.output(qs.TAU3, pull3 - left.effort), speeds.w3_in)
    # A track that an effect makes run at another speed than its drive takes the difference in
    # power from where the effect comes from.
    m.supply(pull2 * (speeds.w2 - speeds.w2_in) + pull3 * (speeds.w3 - speeds.w3_in))
    m.stored_energy(
        planar_body.kinetic_energy(total, first[0], first[1], about_origin, v_x, v_y, w_z)
    )
    m.loss("sliding", -ca.dot(grip, slide_x) - ca.dot(across_grip, slide_y))
    m.loss("rolling", -ca.dot(rolling, forward))


def _turned(angle: SX, x: SX, y: SX) -> tuple[SX, SX]:
    """Vectors in axes that are turned to the left by an angle each."""
    return ca.cos(angle) * x + ca.sin(angle) * y, ca.cos(angle) * y - ca.sin(angle) * x


def _loads(weight: SX, pitch: SX, roll: SX, along: SX, across: SX, count: int) -> SX:
    """Normal forces of the road wheels, linear in their position, from weight and its moments."""
    even = weight / (2 * count)
    slope_x = pitch / ca.sumsqr(along)
    slope_y = roll / ca.sumsqr(across)
    return ca.fmax(even + slope_x * along + slope_y * across, 0)


def _friction(
    m: Model, mu: SX, side: SX, pose: Pose, along: SX, across: SX, sliding: SX
) -> tuple[SX, SX]:
    """Friction coefficients of the road wheels along and across the tracks, open to effects."""
    count = along.numel() // 2
    x, y = rotated(pose.beta, along, across)
    place = {"x": pose.x + x, "y": pose.y + y, "speed": sliding}
    value = mu * ca.SX.ones(2 * count)
    both = m.balance("mu", "coefficient", unit="1", value=value, side=side, **place)
    value = value + both.effort
    halves = []
    for name, part in (("mu_right", slice(0, count)), ("mu_left", slice(count, None))):
        here = {key: item[part] for key, item in place.items()}
        balance = m.balance(name, "coefficient", unit="1", value=value[part], **here)
        halves.append(value[part] + balance.effort)
    along_track = ca.vertcat(*halves)
    lateral = m.balance(
        "mu_lateral", "coefficient", unit="1", value=along_track, longitudinal=along_track, **place
    )
    return ca.fmax(along_track, 0), ca.fmax(along_track + lateral.effort, 0)
