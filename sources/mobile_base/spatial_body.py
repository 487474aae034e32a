"""Rigid body with six degrees of freedom on six wheels, with or without sprung drive wheels.

Orientation R = Rz(phi) Ry(pitch) Rx(roll), twist (v, w) of O in body axes, k the upward vertical in
body axes (third row of R). With the mount at mu from O and everything about the mount:

    v_m = v + w x mu,   a = v_m' + w x v_m,   alpha = w'
    m a + alpha x s + w x (w x s) = F,   s x a + J alpha + w x (J w) = M
    F, M: weight -m g k, normal forces f k, friction, effects, arm -(Lambda [a; alpha] + p)

Wheel i stands at p_i; its centre has the height z + k.p_i and climbs at k.(v + w x p_i + p_i'). A
caster's wheel stands its trail behind the pivot c_i: p_i = c_i + d_i, p_i' = psi_i' z x d_i as the
fork swings, and the torque z.(d_i x f_i k) acts on the fork instead of the body. Friction acts at
the floor below O's neighbourhood, in the body's horizontal plane, on the velocities there:
u = v + w x (0, 0, -r). The forks of the casters take the matrix `relief` off the mass as they
swing, per rate of (u_x, u_y, w_z).

A sprung drive wheel (mass m_u with its carrier, travel h against the body, climbing at c) has

    h' = c - k.(v + w x p),   S = F_0 + k_s h + d_s h',   m_u c' = f_n - S - m_u g

and hands S to the body instead of f_n; sideways and forward its mass counts to the body.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca

from .. import mobile_base as qs
from ..caster.fork import R as CASTER_R
from ..laws.contact import normal_force
from ..laws.symmetric import solve
from ..model import SX, Model
from ..quantity import Quantity
from ..wheel_contact.wheel import WIDTH, B, K
from . import body as bs
from .mount import read_mount, write_motion
from .wheels import (
    CASTERS,
    Drive,
    Foot,
    Places,
    add_wheels,
    caster_parameter,
    read_caster_mass,
    read_feet,
    read_places,
    wheel_parameter,
    write_wheels,
)

LEAST_CARRIER = 1e-3
"""Mass [kg] of a drive wheel with its carrier that springs can move."""
SPRING = Quantity(
    "spring", "N/m", "suspension stiffness of a drive wheel", start=15e3, minimum=1.0, nominal=1e4
)
DAMPER = Quantity(
    "damper", "N.s/m", "suspension damping of a drive wheel", start=500.0, minimum=0.0
)
SPRING_PRELOAD = Quantity(
    "spring_preload", "N", "force of the suspension at zero travel", start=150.0, minimum=0.0
)
TRAVEL_L = Quantity("travel_l", "m", "state: travel of the left drive wheel, positive up")
TRAVEL_R = Quantity("travel_r", "m", "state: travel of the right drive wheel, positive up")
CLIMB_L = Quantity("climb_l", "m/s", "state: vertical velocity of the left drive wheel")
CLIMB_R = Quantity("climb_r", "m/s", "state: vertical velocity of the right drive wheel")


@dataclass(frozen=True)
class _Mass:
    """Mass properties about O; `first` and `inertia` in body axes."""

    mass: SX
    first: SX
    inertia: SX

    def __add__(self, other: _Mass) -> _Mass:
        return _Mass(self.mass + other.mass, self.first + other.first, self.inertia + other.inertia)

    def about(self, point: SX) -> _Mass:
        """The same about another point."""
        s, m, p = self.first, self.mass, point
        shift = m * _steiner(p) - 2 * ca.dot(s, p) * ca.SX.eye(3) + s @ p.T + p @ s.T
        return _Mass(m, s - m * p, self.inertia + shift)

    def energy(self, velocity: SX, rate: SX) -> SX:
        """Kinetic energy."""
        return (
            self.mass * ca.dot(velocity, velocity) / 2
            + ca.dot(velocity, ca.cross(rate, self.first))
            + ca.dot(rate, self.inertia @ rate) / 2
        )


def _steiner(p: SX) -> SX:
    return ca.dot(p, p) * ca.SX.eye(3) - p @ p.T


def _cross_matrix(p: SX) -> SX:
    return ca.vertcat(
        ca.horzcat(0, -p[2], p[1]), ca.horzcat(p[2], 0, -p[0]), ca.horzcat(-p[1], p[0], 0)
    )


def _at(mass: SX, position: SX, inertia: SX) -> _Mass:
    return _Mass(mass, mass * position, inertia + mass * _steiner(position))


def _ring(mass: SX, count: int, x: SX, y: SX, z: SX) -> _Mass:
    """`count` equal masses, symmetric at (+-x, +-y, z)."""
    total = count * mass
    about = ca.diag(ca.vertcat(y**2 + z**2, x**2 + z**2, x**2 + y**2))
    return _Mass(total, ca.vertcat(0, 0, total * z), total * about)


def _base_mass(m: Model, places: Places) -> _Mass:
    """Body and cabinet, with the drive wheels' inertia about their own centres."""
    r = places.radius
    p = m.parameters(
        bs.COM_X,
        bs.COM_Y,
        bs.COM_Z,
        bs.MASS,
        bs.I_XX,
        bs.I_YY,
        bs.I_ZZ,
        bs.CABINET_MASS,
        bs.CABINET_Z,
        bs.CABINET_I_XX,
        bs.CABINET_I_YY,
        bs.CABINET_I_ZZ,
        bs.DRIVE_INERTIA,
    )
    com = ca.vertcat(p.com_x, p.com_y, p.com_z - r)
    load = m.balance("load", "position", value=com)
    body = _at(
        p.mass,
        com + load.effort,
        ca.diag(ca.vertcat(p.I_xx, p.I_yy, p.I_zz)),
    )
    cabinet = _at(
        p.cabinet_mass,
        ca.vertcat(0, 0, p.cabinet_z - r),
        ca.diag(ca.vertcat(p.cabinet_I_xx, p.cabinet_I_yy, p.cabinet_I_zz)),
    )
    transverse = 2 * p.drive_inertia
    turning = _Mass(0, ca.SX.zeros(3), ca.diag(ca.vertcat(transverse, 0, transverse)))
    return body + cabinet + turning


def spatial_body(m: Model, *, sprung: bool = False) -> None:
    """Collect the equations."""
    mount, places, caster_mass = read_mount(m), read_places(m), read_caster_mass(m)
    r = places.radius
    # on springs the carrier's acceleration is its force over its mass
    drive_mass = replace(bs.DRIVE_MASS, minimum=LEAST_CARRIER) if sprung else bs.DRIVE_MASS
    p = m.parameters(drive_mass)
    x = m.states(
        qs.POSE_X,
        qs.POSE_Y,
        qs.POSE_PHI,
        bs.POSE_Z,
        bs.PITCH,
        bs.ROLL,
        bs.VEL_X,
        bs.VEL_Y,
        bs.VEL_Z,
        bs.ROLL_RATE,
        bs.PITCH_RATE,
        bs.YAW_RATE,
    )
    unsprung = 2 * p.drive_mass if sprung else ca.SX(0)
    base = _base_mass(m, places)
    if not sprung:
        base += _ring(p.drive_mass, 2, 0, places.half_track, 0)
    casters = _ring(caster_mass, 4, places.x, places.y, m.parameter(bs.CASTER_Z) - r)

    v: SX = ca.vertcat(x.vel_x, x.vel_y, x.vel_z)
    w: SX = ca.vertcat(x.roll_rate, x.pitch_rate, x.yaw_rate)

    c, s = ca.cos(x.pose_phi), ca.sin(x.pose_phi)
    cp, sp, cr, sr = ca.cos(x.pitch), ca.sin(x.pitch), ca.cos(x.roll), ca.sin(x.roll)
    up = ca.vertcat(-sp, cp * sr, cp * cr)
    rotation = ca.vertcat(
        ca.horzcat(c * cp, c * sp * sr - s * cr, c * sp * cr + s * sr),
        ca.horzcat(s * cp, s * sp * sr + c * cr, s * sp * cr - c * sr),
        up.T,
    )
    half = places.half_track
    plain = base + casters
    body = m.balance(
        "body",
        "body",
        velocity=v,
        rate=w,
        gravity=-bs.GRAVITY * up,
        position=ca.vertcat(x.pose_x, x.pose_y, x.pose_z),
        rotation=rotation,
        mass=plain.mass + unsprung,
        first_moment=plain.first,
    )
    mount = mount.leaning(body.lean)
    payload = _Mass(body.mass, body.first_moment, body.inertia)
    all_mass = plain + payload

    legs = _Legs(m, places, up, x.pose_z, v, w)
    drives = legs.sprung_drives() if sprung else legs.rigid_drives()
    u_x, u_y = v[0] - r * w[1], v[1] + r * w[0]
    u = (u_x, u_y, w[2])
    caster_loads, forks = legs.caster_loads(read_feet(m, places, u))
    wheels = add_wheels(m, places, (x.pose_x, x.pose_y, x.pose_phi), u, drives, caster_loads, forks)
    legs.stand(wheels.lift, p.drive_mass)
    m.eliminate_last(x.pose_x, x.pose_y, x.pose_phi, x.pose_z, x.pitch, x.roll, v, w)

    mu = ca.vertcat(mount.x, mount.y, mount.height - r)
    about = all_mass.about(mu)
    v_m = v + ca.cross(w, mu)
    turning: SX = ca.cross(w, v_m)
    # what rests on the floor below O: friction, swinging forks, horizontal mass of sprung wheels
    ground: SX = ca.vertcat(0, 0, -r) - mu
    reach = ca.SX.zeros(3, 6)
    reach[0, 0] = reach[1, 1] = reach[2, 5] = 1
    reach[0, 4], reach[0, 5] = ground[2], -ground[1]
    reach[1, 3], reach[1, 5] = -ground[2], ground[0]
    relief = wheels.relief - ca.diag(ca.vertcat(unsprung, unsprung, unsprung * half**2))
    floor = ca.vertcat(
        wheels.force_x + unsprung * w[2] * u_y,
        wheels.force_y - unsprung * w[2] * u_x,
        wheels.moment,
    ) - relief @ ca.vertcat(turning[0], turning[1], 0)

    weight_force = -bs.GRAVITY * up
    effort, moment = body.effort[:3], body.effort[3:]
    force = (
        all_mass.mass * weight_force
        + legs.force * up
        + effort
        - ca.cross(w, ca.cross(w, about.first))
        - mount.bias[:3]
    )
    torque = (
        ca.cross(about.first, weight_force)
        + ca.cross(legs.moment - legs.force * mu, up)
        - ca.vertcat(0, 0, sum(forks, ca.SX(0)))
        + moment
        - ca.cross(mu, effort)
        - ca.cross(w, about.inertia @ w)
        - mount.bias[3:]
    )
    skew = _cross_matrix(about.first)
    rigid = ca.vertcat(
        ca.horzcat(about.mass * ca.SX.eye(3), -skew), ca.horzcat(skew, about.inertia)
    )
    q = solve(
        rigid + mount.inertia - reach.T @ relief @ reach,
        ca.vertcat(force, torque) + reach.T @ floor,
    )
    a_m, alpha = q[:3], q[3:]
    m.derivative(v, a_m - turning - ca.cross(alpha, mu))
    m.derivative(w, alpha)
    velocity = rotation @ v
    m.derivative(x.pose_x, velocity[0])
    m.derivative(x.pose_y, velocity[1])
    m.derivative(x.pose_z, ca.dot(up, v))
    yaw = (w[1] * sr + w[2] * cr) / cp
    m.derivative(x.pose_phi, yaw)
    m.derivative(x.pitch, w[1] * cr - w[2] * sr)
    m.derivative(x.roll, w[0] + yaw * sp)

    for quantity, value in (
        (qs.X, x.pose_x),
        (qs.Y, x.pose_y),
        (qs.PHI, x.pose_phi),
        (qs.Z, x.pose_z),
        (qs.V, v[0]),
        (bs.V_Y, v[1]),
        (qs.W_Z, yaw),
    ):
        m.output(quantity, value)
    write_wheels(m, wheels, (*legs.lift, *caster_loads))
    write_motion(
        m,
        mount,
        ca.vertcat(x.pose_x, x.pose_y, x.pose_z) + rotation @ mu,
        _quaternion(x.pose_phi, x.pitch, x.roll),
        v_m,
        w,
        a_m,
        alpha,
    )
    spread = places.x**2 + places.y**2
    planar = (unsprung - 4 * caster_mass) * (u_x**2 + u_y**2)  # the casters count their own
    turn = (unsprung * half**2 - 4 * caster_mass * spread) * w[2] ** 2
    m.stored_energy(all_mass.energy(v, w) + (planar + turn) / 2)
    m.stored_energy(bs.GRAVITY * (all_mass.mass * x.pose_z + ca.dot(up, all_mass.first)))
    wrench = mount.inertia @ q + mount.bias
    m.supply(-ca.dot(wrench[:3], v_m) - ca.dot(wrench[3:], w))


def _quaternion(phi: SX, pitch: SX, roll: SX) -> SX:
    """Rz(phi) Ry(pitch) Rx(roll) as w x y z."""
    c, s = ca.cos(phi / 2), ca.sin(phi / 2)
    cp, sp = ca.cos(pitch / 2), ca.sin(pitch / 2)
    cr, sr = ca.cos(roll / 2), ca.sin(roll / 2)
    return ca.vertcat(
        c * cp * cr + s * sp * sr,
        c * cp * sr - s * sp * cr,
        c * sp * cr + s * cp * sr,
        s * cp * cr - c * sp * sr,
    )


class _Legs:
    """Normal forces at the wheels and what they do to the body.

    Attributes:
        force: sum of the vertical forces on the body [N].
        moment: sum of these forces times where they act (3), body axes [N.m].
        lift: forces of the left and the right drive wheel on the body [N].
    """

    def __init__(self, m: Model, places: Places, up: SX, z: SX, v: SX, w: SX) -> None:
        self.force: SX = ca.SX(0)
        self.moment: SX = ca.SX.zeros(3)
        self.lift: tuple[SX, SX] = (0, 0)
        self._m, self._places = m, places
        self._up, self._z = up, z
        self._climb, self._tilt = ca.dot(up, v), ca.cross(up, w)
        self._seats = [ca.vertcat(0, side * places.half_track, 0) for side in (1, -1)]
        self._springs: tuple[SX, ...] = ()
        self._computes_normal = m.slots["wheel_contact"] == "spatial"
        if not self._computes_normal:
            self._law = [wheel_parameter(m, quantity) for quantity in (K, B, WIDTH)]
        self._moving: list[tuple[SX, SX]] = []

    def _height(self, p: SX) -> SX:
        return self._z + ca.dot(self._up, p)

    def _rise(self, p: SX) -> SX:
        return self._climb + ca.dot(self._tilt, p)

    def _push(self, p: SX, force: SX) -> None:
        self.force += force
        self.moment += force * p

    def _normal(self, name: str, depth: SX, rate: SX, law: Sequence[SX]) -> SX:
        force, energy, loss = normal_force(depth, rate, law[0], law[1], law[2])
        self._m.stored_energy(energy)
        self._m.loss(name, loss)
        return force

    def caster_loads(self, feet: Sequence[Foot]) -> tuple[list[SX], list[SX]]:
        """Normal forces of the casters, which push the body too, and what turns their forks."""
        r_c = caster_parameter(self._m, CASTER_R)
        law = [caster_parameter(self._m, quantity) for quantity in (K, B, WIDTH)]
        loads, torques = [], []
        for (name, _, _), foot in zip(CASTERS, feet, strict=True):
            p = ca.vertcat(foot.pivot_x + foot.x, foot.pivot_y + foot.y, r_c - self._places.radius)
            lean = foot.x * self._up[1] - foot.y * self._up[0]  # z.(d x k) = (z x d).k
            depth, rate = r_c - self._height(p), -self._rise(p) - lean * foot.swing
            loads.append(self._normal(f"{name}.normal", depth, rate, law))
            torques.append(lean * loads[-1])
            self._push(p, loads[-1])
        return loads, torques

    def rigid_drives(self) -> tuple[Drive, Drive]:
        """Drive wheels that are fixed in the body."""
        left, right = (
            self._drive(name, self._height(p), self._rise(p))
            for name, p in zip(("left", "right"), self._seats, strict=True)
        )
        return left, right

    def sprung_drives(self) -> tuple[Drive, Drive]:
        """Drive wheels on springs, with states of their own."""
        m = self._m
        p = m.parameters(SPRING, DAMPER, SPRING_PRELOAD)
        drives, springs = [], []
        for name, seat, travelled, climbing in zip(
            ("left", "right"), self._seats, (TRAVEL_L, TRAVEL_R), (CLIMB_L, CLIMB_R), strict=True
        ):
            h, c = m.state(travelled), m.state(climbing)
            rate = c - self._rise(seat)
            m.derivative(h, rate)
            height = self._height(seat) + h
            drives.append(self._drive(name, height, c))
            springs.append(p.spring_preload + p.spring * h + p.damper * rate)
            m.stored_energy((p.spring_preload + p.spring * h / 2) * h)
            m.loss(f"{name}.damper", p.damper * rate**2)
            self._moving.append((c, height))
        self._springs = tuple(springs)
        return drives[0], drives[1]

    def _drive(self, name: str, height: SX, rise: SX) -> Drive:
        if self._computes_normal:
            return Drive(0, height, rise)
        depth = self._places.radius - height
        return Drive(self._normal(f"{name}.normal", depth, -rise, self._law), height, rise)

    def stand(self, contact: tuple[SX, SX], mass: SX) -> None:
        """Let the drive wheels push: the normal forces, or the springs between."""
        if self._springs:
            for (c, height), f_n, spring in zip(self._moving, contact, self._springs, strict=True):
                self._m.derivative(c, (f_n - spring) / mass - bs.GRAVITY)
                self._m.stored_energy(mass * (c**2 / 2 + bs.GRAVITY * height))
            self.lift = (self._springs[0], self._springs[1])
        else:
            self.lift = contact
        for p, force in zip(self._seats, self.lift, strict=True):
            self._push(p, force)
