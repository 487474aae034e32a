"""Kinematics and dynamics of a serial chain of rigid links with revolute joints on a moving mount.

Link `i` carries a frame whose z axis is joint axis `i` and whose origin lies on it; it is turned by
`q_i` against axes that are fixed in its predecessor. (Frame i-1 of the standard Denavit-Hartenberg
convention, turned by `q_i`.) The joint axis is then (0, 0, 1) in every link, numbers that are zero
stay structurally zero, and the C code holds no needless operation.

Wrenches are [force; moment], motions [linear; angular], both at the frame's origin in its axes.
Accelerations are classical ones (second derivative of the position) and not spatial ones: then no
linear velocity enters the equations of motion, in agreement with Galilean invariance. Gravity acts
as the upward acceleration `-g` of the mount.

    link:   F = m a + alpha x h + w x (w x h),   M = J alpha + h x a + w x (J w)
    joint:  a_i = a_p + alpha_p x r + w_p x (w_p x r),   alpha_i = alpha_p + w_p x z qd + z qdd

with the mass m, first moment h and inertia J of a link about its frame's origin and the offset r of
the joint from the predecessor's origin. A rotor inertia J_r acts on the joint's own acceleration
only (its gyroscopic moments are neglected): z.M = tau - J_r qdd.

Source: Featherstone, Rigid Body Dynamics Algorithms, 2008 (RNEA ch. 5, CRBA ch. 6, ABA ch. 7),
rewritten for classical accelerations.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

SX = Any


@dataclass(frozen=True)
class Link:
    """A link and the joint before it.

    Attributes:
        rotation: axes of the joint at `q = 0` in the axes of the predecessor (3x3).
        offset: position of the joint in the predecessor's frame [m].
        mass: [kg].
        first_moment: mass times centre of mass [kg.m].
        inertia: about the frame's origin [kg.m2] (3x3).
    """

    rotation: SX
    offset: SX
    mass: SX
    first_moment: SX
    inertia: SX


@dataclass(frozen=True)
class Chain:
    """Links from the mount to the tool; the flange is fixed in the last link."""

    links: tuple[Link, ...]
    flange_rotation: SX
    flange_offset: SX


@dataclass(frozen=True)
class Body:
    """Mass properties about the origin of a frame, in its axes."""

    mass: SX
    first_moment: SX
    inertia: SX

    def matrix(self) -> SX:
        """Wrench per acceleration [linear; angular] of the frame (6x6)."""
        cross = skew(self.first_moment)
        return ca.vertcat(
            ca.horzcat(self.mass * ca.SX.eye(3), -cross), ca.horzcat(cross, self.inertia)
        )


@dataclass(frozen=True)
class ForwardDynamics:
    """Result of the articulated-body algorithm.

    Attributes:
        acceleration: joint accelerations [rad/s2].
        inertia: articulated inertia at the mount (6x6): wrench of the mount on the chain per
            acceleration [linear; angular] of the mount, with the joints free to follow.
        bias: that wrench for a mount that is not accelerated, without gravity.
    """

    acceleration: SX
    inertia: SX
    bias: SX


def standard_dh(
    d: Sequence[float],
    a: Sequence[float],
    alpha: Sequence[float],
    mass: Sequence[float],
    centre: Sequence[Sequence[float]],
    inertia: Sequence[Sequence[float]],
) -> Chain:
    """Chain from standard Denavit-Hartenberg data, T_i = Rz(q_i) Tz(d_i) Tx(a_i) Rx(alpha_i).

    Args:
        d, a, alpha: link offsets [m], lengths [m] and twists [rad].
        mass: masses [kg].
        centre: centres of mass in frame i [m].
        inertia: (Ixx, Iyy, Izz, Ixy, Ixz, Iyz) about the centre of mass in axes i [kg.m2].
    """
    links = []
    rotation, offset = np.eye(3), np.zeros(3)
    for i in range(len(d)):
        turn, shift = _rotation_x(alpha[i]), np.array([a[i], 0.0, d[i]])
        c = shift + turn @ np.asarray(centre[i])
        xx, yy, zz, xy, xz, yz = inertia[i]
        about_centre = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
        about_origin = about_centre + mass[i] * (c @ c * np.eye(3) - np.outer(c, c))
        links.append(
            Link(
                ca.SX(rotation),
                ca.SX(offset),
                ca.SX(mass[i]),
                ca.SX(mass[i] * c),
                ca.SX(about_origin),
            )
        )
        rotation, offset = turn, shift
    return Chain(tuple(links), ca.SX(rotation), ca.SX(offset))


def _rotation_x(angle: float) -> Any:
    """Rotation about x; cosines and sines of right angles are exactly 0 or 1."""
    c, s = np.cos(angle), np.sin(angle)
    c, s = (float(np.round(v)) if abs(v - np.round(v)) < 1e-7 else float(v) for v in (c, s))
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def with_load(chain: Chain, mass: SX, first_moment: SX, inertia: SX) -> Chain:
    """The chain with a rigid load on its flange (first moment and inertia about the flange)."""
    last = chain.links[-1]
    turn, shift = chain.flange_rotation, chain.flange_offset
    h = turn @ ca.SX(first_moment)
    J = _symmetric(turn @ ca.SX(inertia) @ turn.T)
    link = replace(
        last,
        mass=last.mass + mass,
        first_moment=last.first_moment + (h + mass * shift),
        inertia=last.inertia + (J + _shifted(mass, h, shift)),
    )
    return replace(chain, links=(*chain.links[:-1], link))


def _shifted(m: SX, h: SX, r: SX) -> SX:
    """What an inertia gains when its reference point moves by -r (h: first moment before)."""
    return _symmetric(
        (2 * ca.dot(r, h) + m * ca.dot(r, r)) * ca.SX.eye(3) - r @ h.T - h @ r.T - m * (r @ r.T)
    )


def _symmetric(matrix: SX) -> SX:
    """The upper triangle mirrored: the lower one is never computed."""
    return ca.triu2symm(ca.triu(matrix))


def skew(v: SX) -> SX:
    """Matrix of the cross product, `skew(v) @ w = v x w`."""
    return ca.skew(v)


class Posture:
    """A chain at given joint angles: the rotations that everything else needs, computed once."""

    def __init__(self, chain: Chain, q: SX) -> None:
        self.chain = chain
        self._q = q
        self._bare = chain
        self._load: Body | None = None
        self._cos = [ca.cos(q[i]) for i in range(len(chain.links))]
        self._sin = [ca.sin(q[i]) for i in range(len(chain.links))]

    def carrying(self, mass: SX, first_moment: SX, inertia: SX) -> Posture:
        """The same posture with a rigid load on the flange (moments about the flange)."""
        if self._load is not None:
            raise ValueError("the flange carries a load already")
        loaded = copy(self)
        loaded.chain = with_load(self.chain, mass, first_moment, inertia)
        loaded._load = Body(ca.SX(mass), ca.SX(first_moment), ca.SX(inertia))
        return loaded

    def _turn(self, i: int, v: SX) -> SX:
        c, s = self._cos[i], self._sin[i]
        return ca.vertcat(c * v[0] - s * v[1], s * v[0] + c * v[1], v[2])

    def down(self, i: int, v: SX) -> SX:
        """A vector in the axes of link i, in the axes of its predecessor."""
        return self.chain.links[i].rotation @ self._turn(i, v)

    def up(self, i: int, v: SX) -> SX:
        """A vector in the axes of the predecessor of link i, in the axes of link i."""
        w = self.chain.links[i].rotation.T @ v
        c, s = self._cos[i], self._sin[i]
        return ca.vertcat(c * w[0] + s * w[1], c * w[1] - s * w[0], w[2])

    def _down_symmetric(self, i: int, matrix: SX) -> SX:
        c, s = self._cos[i], self._sin[i]
        xx, xy, yy = matrix[0, 0], matrix[0, 1], matrix[1, 1]
        cs, ss = c * s, s * s
        shift = ss * (yy - xx) - 2 * cs * xy
        xy_new = cs * (xx - yy) + (1 - 2 * ss) * xy
        xz = c * matrix[0, 2] - s * matrix[1, 2]
        yz = s * matrix[0, 2] + c * matrix[1, 2]
        turned = ca.vertcat(
            ca.horzcat(xx + shift, xy_new, xz),
            ca.horzcat(xy_new, yy - shift, yz),
            ca.horzcat(xz, yz, matrix[2, 2]),
        )
        rotation = self.chain.links[i].rotation
        return _symmetric(rotation @ turned @ rotation.T)

    def _down_matrix(self, i: int, matrix: SX) -> SX:
        columns = [self.down(i, matrix[:, k]) for k in range(3)]
        rows = ca.horzcat(*columns).T
        return ca.horzcat(*[self.down(i, rows[:, k]) for k in range(3)]).T

    # -- kinematics ------------------------------------------------------------------------------

    def flange(self) -> tuple[SX, SX]:
        """Position of the flange in the mount's frame and its rotation matrix."""
        rotation = self.chain.flange_rotation
        position = self.chain.flange_offset
        for i in reversed(range(len(self.chain.links))):
            position = self.chain.links[i].offset + self.down(i, position)
            rotation = ca.horzcat(*[self.down(i, rotation[:, k]) for k in range(3)])
        return position, rotation

    def flange_quaternion(self) -> SX:
        """Rotation of the flange against the mount, a quaternion of any length."""
        quaternion = ca.SX([1, 0, 0, 0])
        turns = [link.rotation for link in self.chain.links[1:]] + [self.chain.flange_rotation]
        for i, turn in enumerate(turns):
            w, x, y, z = (quaternion[k] for k in range(4))
            c, s = ca.cos(self._q[i] / 2), ca.sin(self._q[i] / 2)
            w, x, y, z = w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s
            # about x by alpha: the half angle's cosine and sine times 2 cos(alpha/2)
            cos, sin = 1 + float(turn[1, 1]), float(turn[2, 1])
            quaternion = ca.vertcat(
                w * cos - x * sin, x * cos + w * sin, y * cos + z * sin, z * cos - y * sin
            )
        return quaternion

    def rates(self, qd: SX, base_rate: SX) -> list[SX]:
        """Angular velocities of the links in their own axes."""
        w, result = base_rate, []
        for i in range(len(self.chain.links)):
            w = self.up(i, w)
            w = ca.vertcat(w[0], w[1], w[2] + qd[i])
            result.append(w)
        return result

    def velocities(self, rates: list[SX], base_velocity: SX, base_rate: SX) -> list[SX]:
        """Velocities of the origins of the links in their own axes."""
        v, w, result = base_velocity, base_rate, []
        for i, link in enumerate(self.chain.links):
            v = self.up(i, v + ca.cross(w, link.offset))
            w = rates[i]
            result.append(v)
        return result

    def flange_motion(self, rates: list[SX], velocities: list[SX]) -> tuple[SX, SX]:
        """Velocity and angular velocity of the flange in its own axes."""
        turn = self.chain.flange_rotation.T
        v = velocities[-1] + ca.cross(rates[-1], self.chain.flange_offset)
        return turn @ v, turn @ rates[-1]

    def mass_properties(self) -> Body:
        """Mass, first moment and inertia of the whole chain about the mount.

        A load is added last: inside the last link it would keep products of numbers from being
        folded, and the chain would round differently with a load of 0 than without one.
        """
        if self._load is None:
            return self._composite()[0]
        bare = copy(self)
        bare.chain = self._bare
        whole, load = bare._composite()[0], self._load
        position, rotation = self.flange()
        h = rotation @ load.first_moment
        J = _symmetric(rotation @ load.inertia @ rotation.T)
        return Body(
            whole.mass + load.mass,
            whole.first_moment + (h + load.mass * position),
            whole.inertia + (J + _shifted(load.mass, h, position)),
        )

    def _composite(self) -> list[Body]:
        """Per frame (0: mount) the mass properties of all that lies beyond it."""
        bodies = []
        m, h, J = ca.SX(0), ca.SX.zeros(3), ca.SX.zeros(3, 3)
        for i in reversed(range(len(self.chain.links))):
            link = self.chain.links[i]
            m, h, J = m + link.mass, h + link.first_moment, J + link.inertia
            bodies.append(Body(m, h, J))
            h, J = self.down(i, h), self._down_symmetric(i, J)
            J = J + _shifted(m, h, link.offset)
            h = h + m * link.offset
        bodies.append(Body(m, h, J))
        return bodies[::-1]

    # -- energy ----------------------------------------------------------------------------------

    def kinetic_energy(self, rates: list[SX], velocities: list[SX]) -> SX:
        """Kinetic energy of the links [J] (rotors not included)."""
        total = ca.SX(0)
        for link, w, v in zip(self.chain.links, rates, velocities, strict=True):
            m, h, J = link.mass, link.first_moment, link.inertia
            total += m * ca.dot(v, v) / 2 + ca.dot(v, ca.cross(w, h)) + ca.dot(w, J @ w) / 2
        return total

    # -- dynamics --------------------------------------------------------------------------------

    def inverse_dynamics(
        self,
        qd: SX,
        qdd: SX,
        *,
        base_rate: SX,
        base_acceleration: SX,
        base_angular_acceleration: SX,
        load: SX | None = None,
    ) -> tuple[SX, SX]:
        """Joint torques and wrench of the mount on the chain (recursive Newton-Euler).

        Args:
            qd, qdd: joint speeds and accelerations.
            base_rate: angular velocity of the mount.
            base_acceleration: of the mount minus gravity.
            base_angular_acceleration: of the mount.
            load: wrench on the flange, in its axes.
        """
        rates = self.rates(qd, base_rate)
        a, alpha, w = base_acceleration, base_angular_acceleration, base_rate
        wrenches = []
        for i, link in enumerate(self.chain.links):
            m, h, J, r = link.mass, link.first_moment, link.inertia, link.offset
            a = self.up(i, a + ca.cross(alpha, r) + _centripetal(w, r))
            alpha, w = self.up(i, alpha) + _coriolis(rates[i], qd[i]), rates[i]
            alpha = ca.vertcat(alpha[0], alpha[1], alpha[2] + qdd[i])
            F = m * a + ca.cross(alpha, h) + _centripetal(w, h)
            M = J @ alpha + ca.cross(h, a) + ca.cross(w, J @ w)
            wrenches.append((F, M))
        tau = []
        F, M = self._minus_load(load)
        for i in reversed(range(len(self.chain.links))):
            F, M = F + wrenches[i][0], M + wrenches[i][1]
            tau.append(M[2])
            F, M = self.down(i, F), self.down(i, M)
            M = M + ca.cross(self.chain.links[i].offset, F)
        return ca.vertcat(*tau[::-1]), ca.vertcat(F, M)

    def _minus_load(self, load: SX | None) -> tuple[SX, SX]:
        if load is None:
            return ca.SX.zeros(3), ca.SX.zeros(3)
        F = self.chain.flange_rotation @ load[:3]
        M = self.chain.flange_rotation @ load[3:] + ca.cross(self.chain.flange_offset, F)
        return -F, -M

    def mass_matrix(self) -> SX:
        """Joint inertia matrix (composite rigid bodies; rotors not included)."""
        size = len(self.chain.links)
        bodies = self._composite()[1:]
        matrix = ca.SX.zeros(size, size)
        for i in range(size):
            h = bodies[i].first_moment
            F, M = ca.vertcat(-h[1], h[0], 0), bodies[i].inertia[:, 2]
            matrix[i, i] = M[2]
            for k in range(i, 0, -1):
                F, M = self.down(k, F), self.down(k, M)
                M = M + ca.cross(self.chain.links[k].offset, F)
                matrix[k - 1, i] = matrix[i, k - 1] = M[2]
        return matrix

    def forward_dynamics(
        self,
        qd: SX,
        tau: SX,
        rotor: SX,
        *,
        base_rate: SX,
        base_acceleration: SX,
        base_angular_acceleration: SX,
        load: SX | None = None,
    ) -> ForwardDynamics:
        """Joint accelerations and articulated inertia at the mount (articulated bodies).

        Args:
            qd: joint speeds.
            tau: joint torques.
            rotor: inertias of the rotors, seen at the joints.
            base_rate: angular velocity of the mount.
            base_acceleration: of the mount minus gravity.
            base_angular_acceleration: of the mount.
            load: wrench on the flange, in its axes.
        """
        links, rates = self.chain.links, self.rates(qd, base_rate)
        mass, cross, inertia = ca.SX.zeros(3, 3), ca.SX.zeros(3, 3), ca.SX.zeros(3, 3)
        F, M = self._minus_load(load)
        joints: list[tuple[SX, SX, SX, SX]] = []
        for i in reversed(range(len(links))):
            link, w = links[i], rates[i]
            m, h, J, r = link.mass, link.first_moment, link.inertia, link.offset
            mass = mass + m * ca.SX.eye(3)
            cross = cross - skew(h)
            inertia = inertia + J
            F = F + _centripetal(w, h)
            M = M + ca.cross(w, J @ w)

            # the joint gives way: what remains is felt across it
            u_force, u_moment = cross[:, 2], inertia[:, 2]
            inverse = 1 / (u_moment[2] + rotor[i])
            torque = tau[i] - M[2]
            joints.append((u_force, u_moment, inverse, torque))
            # these quotients first, so that numbers known at build time round as at run time
            kept, by_force, by_moment = (
                rotor[i] * inverse,
                u_force * inverse,
                u_moment[:2] * inverse,
            )
            mass = _symmetric(mass - by_force @ u_force.T)
            cross = ca.horzcat(cross[:, :2] - by_force @ u_moment[:2].T, u_force * kept)
            corner = _symmetric(inertia[:2, :2] - by_moment @ u_moment[:2].T)
            edge = u_moment * kept
            inertia = ca.vertcat(ca.horzcat(corner, edge[:2]), edge.T)
            turning = _coriolis(w, qd[i])[:2]
            F = F + by_force * torque + cross[:, :2] @ turning
            passed = ca.vertcat(M[:2] + by_moment * torque, tau[i] - kept * torque)
            M = passed + inertia[:, :2] @ turning

            # to the frame of the predecessor
            w_p = rates[i - 1] if i else base_rate
            mass, inertia = self._down_symmetric(i, mass), self._down_symmetric(i, inertia)
            cross, shift = self._down_matrix(i, cross), skew(r)
            centripetal = _centripetal(w_p, r)
            F = self.down(i, F) + mass @ centripetal
            M = self.down(i, M) + cross.T @ centripetal + ca.cross(r, F)
            shifted = cross - mass @ shift
            inertia = _symmetric(inertia - cross.T @ shift + shift @ shifted)
            cross = shifted

        joints.reverse()
        qdd = []
        a, alpha, w = base_acceleration, base_angular_acceleration, base_rate
        for i, (u_force, u_moment, inverse, torque) in enumerate(joints):
            r = links[i].offset
            a = self.up(i, a + ca.cross(alpha, r) + _centripetal(w, r))
            alpha, w = self.up(i, alpha) + _coriolis(rates[i], qd[i]), rates[i]
            acceleration = inverse * (torque - ca.dot(u_force, a) - ca.dot(u_moment, alpha))
            alpha = ca.vertcat(alpha[0], alpha[1], alpha[2] + acceleration)
            qdd.append(acceleration)
        return ForwardDynamics(
            ca.vertcat(*qdd),
            ca.vertcat(ca.horzcat(mass, cross), ca.horzcat(cross.T, inertia)),
            ca.vertcat(F, M),
        )


def _centripetal(w: SX, r: SX) -> SX:
    return ca.cross(w, ca.cross(w, r))


def _coriolis(w: SX, qd: SX) -> SX:
    """Angular acceleration of a link from its joint's speed, `w x (0, 0, qd)`."""
    return ca.vertcat(w[1] * qd, -w[0] * qd, 0)


def upper_triangle(matrix: SX) -> SX:
    """Upper triangle of a symmetric matrix, row by row."""
    size = matrix.shape[0]
    return ca.vertcat(*[matrix[i, k] for i in range(size) for k in range(i, size)])
