"""Kinematics and dynamics of a serial chain of rigid links on a moving mount.

Link `i` carries a frame whose z axis is joint axis `i` and whose origin lies on it; a revolute
joint turns it by `q_i` against axes that are fixed in its predecessor, a prismatic one moves it by
`q_i`. (Frame i-1 of the standard Denavit-Hartenberg convention, turned by `q_i`.) The joint axis is
then (0, 0, 1) in every link, numbers that are zero stay structurally zero, and the C code holds no
needless operation.

Wrenches are [force; moment], motions [linear; angular], both at the frame's origin in its axes.
Accelerations are classical ones (second derivative of the position) and not spatial ones: then no
linear velocity enters the equations of motion, in agreement with Galilean invariance. Gravity acts
as the upward acceleration `-g` of the mount.

    link:   F = m a + alpha x h + w x (w x h),   M = J alpha + h x a + w x (J w)
    joint:  a_i = a_p + alpha_p x r + w_p x (w_p x r),   alpha_i = alpha_p + w_p x z qd + z qdd

with the mass m, first moment h and inertia J of a link about its frame's origin and the offset r of
its frame from the predecessor's origin. Along a prismatic joint r grows by z q, a_i gains
2 w_i x z qd + z qdd, and alpha_i = alpha_p. A rotor inertia J_r acts on the joint's own
acceleration only (its gyroscopic moments are neglected): z.M = tau - J_r qdd, or z.F of a prismatic
joint.

Source: Featherstone, Rigid Body Dynamics Algorithms, 2008 (RNEA ch. 5, CRBA ch. 6, ABA ch. 7),
rewritten for classical accelerations.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from .chain import (
    Body,
    Chain,
    Link,
    quaternion_of,
    shifted,
    skew,
    standard_dh,
    symmetric,
    with_load,
)
from .rotation import product

SX = Any

__all__ = ["Body", "Chain", "ForwardDynamics", "Link", "Posture", "standard_dh", "upper_triangle"]


@dataclass(frozen=True)
class ForwardDynamics:
    """Result of the articulated-body algorithm.

    Attributes:
        acceleration: of the joints [rad/s2], prismatic [m/s2].
        inertia: articulated inertia at the mount (6x6): wrench of the mount on the chain per
            acceleration [linear; angular] of the mount, with the joints free to follow.
        bias: that wrench for a mount that is not accelerated, without gravity.
    """

    acceleration: SX
    inertia: SX
    bias: SX


class Posture:
    """A chain at given joint positions: what everything else needs of them, computed once."""

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

    def _offset(self, i: int) -> SX:
        """Origin of link i in the frame of its predecessor."""
        link = self.chain.links[i]
        return link.offset + link.rotation[:, 2] * self._q[i] if link.prismatic else link.offset

    def _turn(self, i: int, v: SX) -> SX:
        if self.chain.links[i].prismatic:
            return v
        c, s = self._cos[i], self._sin[i]
        return ca.vertcat(c * v[0] - s * v[1], s * v[0] + c * v[1], v[2])

    def down(self, i: int, v: SX) -> SX:
        """A vector in the axes of link i, in the axes of its predecessor."""
        return self.chain.links[i].rotation @ self._turn(i, v)

    def up(self, i: int, v: SX) -> SX:
        """A vector in the axes of the predecessor of link i, in the axes of link i."""
        w = self.chain.links[i].rotation.T @ v
        if self.chain.links[i].prismatic:
            return w
        c, s = self._cos[i], self._sin[i]
        return ca.vertcat(c * w[0] + s * w[1], c * w[1] - s * w[0], w[2])

    def _down_symmetric(self, i: int, matrix: SX) -> SX:
        rotation = self.chain.links[i].rotation
        if self.chain.links[i].prismatic:
            return symmetric(rotation @ matrix @ rotation.T)
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
        return symmetric(rotation @ turned @ rotation.T)

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
            position = self._offset(i) + self.down(i, position)
            rotation = ca.horzcat(*[self.down(i, rotation[:, k]) for k in range(3)])
        return position, rotation

    def flange_quaternion(self) -> SX:
        """Rotation of the flange against the mount, a quaternion of any length."""
        quaternion = ca.SX([1, 0, 0, 0])
        turns = [link.rotation for link in self.chain.links] + [self.chain.flange_rotation]
        for i, turn in enumerate(turns):
            if i and not self.chain.links[i - 1].prismatic:
                w, x, y, z = (quaternion[k] for k in range(4))
                c, s = ca.cos(self._q[i - 1] / 2), ca.sin(self._q[i - 1] / 2)
                quaternion = ca.vertcat(w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s)
            if i or not _is_identity(turn):
                quaternion = _turned(quaternion, turn)
        return quaternion

    def rates(self, qd: SX, base_rate: SX) -> list[SX]:
        """Angular velocities of the links in their own axes."""
        w, result = base_rate, []
        for i in range(len(self.chain.links)):
            w = self.up(i, w)
            if not self.chain.links[i].prismatic:
                w = ca.vertcat(w[0], w[1], w[2] + qd[i])
            result.append(w)
        return result

    def velocities(self, rates: list[SX], base_velocity: SX, base_rate: SX, qd: SX) -> list[SX]:
        """Velocities of the origins of the links in their own axes."""
        v, w, result = base_velocity, base_rate, []
        for i, link in enumerate(self.chain.links):
            v = self.up(i, v + ca.cross(w, self._offset(i)))
            if link.prismatic:
                v = ca.vertcat(v[0], v[1], v[2] + qd[i])
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
        J = symmetric(rotation @ load.inertia @ rotation.T)
        return Body(
            whole.mass + load.mass,
            whole.first_moment + (h + load.mass * position),
            whole.inertia + (J + shifted(load.mass, h, position)),
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
            offset = self._offset(i)
            J = J + shifted(m, h, offset)
            h = h + m * offset
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
            m, h, J, r = link.mass, link.first_moment, link.inertia, self._offset(i)
            a, alpha, w = *self._carried(i, a, alpha, w, rates[i], qd[i], r), rates[i]
            if link.prismatic:
                a = ca.vertcat(a[0], a[1], a[2] + qdd[i])
            else:
                alpha = ca.vertcat(alpha[0], alpha[1], alpha[2] + qdd[i])
            F = m * a + ca.cross(alpha, h) + _centripetal(w, h)
            M = J @ alpha + ca.cross(h, a) + ca.cross(w, J @ w)
            wrenches.append((F, M))
        tau = []
        F, M = self._minus_load(load)
        for i in reversed(range(len(self.chain.links))):
            F, M = F + wrenches[i][0], M + wrenches[i][1]
            tau.append(F[2] if self.chain.links[i].prismatic else M[2])
            F, M = self.down(i, F), self.down(i, M)
            M = M + ca.cross(self._offset(i), F)
        return ca.vertcat(*tau[::-1]), ca.vertcat(F, M)

    def _carried(self, i: int, a: SX, alpha: SX, w: SX, w_own: SX, qd: SX, r: SX) -> tuple[SX, SX]:
        """Acceleration of link i, in its axes, without that of its joint."""
        a, alpha = self.up(i, a + ca.cross(alpha, r) + _centripetal(w, r)), self.up(i, alpha)
        if self.chain.links[i].prismatic:
            return a + 2 * _coriolis(w_own, qd), alpha
        return a, alpha + _coriolis(w_own, qd)

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
            if self.chain.links[i].prismatic:
                F, M = ca.vertcat(0, 0, bodies[i].mass), ca.vertcat(h[1], -h[0], 0)
                matrix[i, i] = F[2]
            else:
                F, M = ca.vertcat(-h[1], h[0], 0), bodies[i].inertia[:, 2]
                matrix[i, i] = M[2]
            for k in range(i, 0, -1):
                F, M = self.down(k, F), self.down(k, M)
                M = M + ca.cross(self._offset(k), F)
                felt = F[2] if self.chain.links[k - 1].prismatic else M[2]
                matrix[k - 1, i] = matrix[i, k - 1] = felt
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
        joints: list[_GivingJoint] = []
        for i in reversed(range(len(links))):
            link, w = links[i], rates[i]
            m, h, J, r = link.mass, link.first_moment, link.inertia, self._offset(i)
            mass = mass + m * ca.SX.eye(3)
            cross = cross - skew(h)
            inertia = inertia + J
            F = F + _centripetal(w, h)
            M = M + ca.cross(w, J @ w)

            joint = _give_way(
                link.prismatic, mass, cross, inertia, F, M, w, qd[i], tau[i], rotor[i]
            )
            mass, cross, inertia, F, M = joint.passed
            joints.append(joint)

            # to the frame of the predecessor
            w_p = rates[i - 1] if i else base_rate
            mass, inertia = self._down_symmetric(i, mass), self._down_symmetric(i, inertia)
            cross, shift = self._down_matrix(i, cross), skew(r)
            centripetal = _centripetal(w_p, r)
            F = self.down(i, F) + mass @ centripetal
            M = self.down(i, M) + cross.T @ centripetal + ca.cross(r, F)
            shifted = cross - mass @ shift
            inertia = symmetric(inertia - cross.T @ shift + shift @ shifted)
            cross = shifted

        joints.reverse()
        qdd = []
        a, alpha, w = base_acceleration, base_angular_acceleration, base_rate
        for i, joint in enumerate(joints):
            a, alpha = self._carried(i, a, alpha, w, rates[i], qd[i], self._offset(i))
            w = rates[i]
            acceleration = joint.inverse * (
                joint.torque - ca.dot(joint.u_force, a) - ca.dot(joint.u_moment, alpha)
            )
            if links[i].prismatic:
                a = ca.vertcat(a[0], a[1], a[2] + acceleration)
            else:
                alpha = ca.vertcat(alpha[0], alpha[1], alpha[2] + acceleration)
            qdd.append(acceleration)
        return ForwardDynamics(
            ca.vertcat(*qdd),
            ca.vertcat(ca.horzcat(mass, cross), ca.horzcat(cross.T, inertia)),
            ca.vertcat(F, M),
        )


class _GivingJoint(NamedTuple):
    """A joint that gives way: its column of the inertia, and what is felt across it.

    `passed`: inertia (mass, cross, inertia) and bias (force, moment) in the axes of its link.
    """

    u_force: SX
    u_moment: SX
    inverse: SX
    torque: SX
    passed: tuple[SX, SX, SX, SX, SX]


def _give_way(
    prismatic: bool,
    mass: SX,
    cross: SX,
    inertia: SX,
    F: SX,
    M: SX,
    w: SX,
    qd: SX,
    tau: SX,
    rotor: SX,
) -> _GivingJoint:
    """What is felt across a joint under a torque, from the inertia and bias beyond it."""
    if prismatic:
        u_force, u_moment = mass[:, 2], cross[2, :].T
        inverse = 1 / (u_force[2] + rotor)
        torque = tau - F[2]
        kept, by_force, by_moment = rotor * inverse, u_force[:2] * inverse, u_moment * inverse
        corner = symmetric(mass[:2, :2] - by_force @ u_force[:2].T)
        edge = u_force * kept
        mass = ca.vertcat(ca.horzcat(corner, edge[:2]), edge.T)
        cross = ca.vertcat(cross[:2, :] - by_force @ u_moment.T, u_moment.T * kept)
        inertia = symmetric(inertia - by_moment @ u_moment.T)
        moving = 2 * _coriolis(w, qd)[:2]
        F = ca.vertcat(F[:2] + by_force * torque, tau - kept * torque) + mass[:, :2] @ moving
        M = M + by_moment * torque + cross[:2, :].T @ moving
        return _GivingJoint(u_force, u_moment, inverse, torque, (mass, cross, inertia, F, M))
    u_force, u_moment = cross[:, 2], inertia[:, 2]
    inverse = 1 / (u_moment[2] + rotor)
    torque = tau - M[2]
    # these quotients first, so that numbers known at build time round as at run time
    kept, by_force, by_moment = rotor * inverse, u_force * inverse, u_moment[:2] * inverse
    mass = symmetric(mass - by_force @ u_force.T)
    cross = ca.horzcat(cross[:, :2] - by_force @ u_moment[:2].T, u_force * kept)
    corner = symmetric(inertia[:2, :2] - by_moment @ u_moment[:2].T)
    edge = u_moment * kept
    inertia = ca.vertcat(ca.horzcat(corner, edge[:2]), edge.T)
    turning = _coriolis(w, qd)[:2]
    F = F + by_force * torque + cross[:, :2] @ turning
    passed = ca.vertcat(M[:2] + by_moment * torque, tau - kept * torque)
    M = passed + inertia[:, :2] @ turning
    return _GivingJoint(u_force, u_moment, inverse, torque, (mass, cross, inertia, F, M))


def _is_identity(turn: SX) -> bool:
    return bool(np.array_equal(np.array(ca.DM(turn)), np.eye(3)))


def _turned(quaternion: SX, turn: SX) -> SX:
    """A quaternion, then a fixed rotation; of any length."""
    w, x, y, z = (quaternion[k] for k in range(4))
    fixed = np.array(ca.DM(turn))
    if fixed[0, 0] == 1.0 and fixed[1, 1] > -0.5:  # a half turn would be scaled by 0
        # about x by alpha: the half angle's cosine and sine times 2 cos(alpha/2)
        cos, sin = 1 + float(turn[1, 1]), float(turn[2, 1])
        return ca.vertcat(
            w * cos - x * sin, x * cos + w * sin, y * cos + z * sin, z * cos - y * sin
        )
    return product(quaternion, ca.SX(quaternion_of(fixed)))


def _centripetal(w: SX, r: SX) -> SX:
    return ca.cross(w, ca.cross(w, r))


def _coriolis(w: SX, qd: SX) -> SX:
    """Angular acceleration of a link from its joint's speed, `w x (0, 0, qd)`."""
    return ca.vertcat(w[1] * qd, -w[0] * qd, 0)


def upper_triangle(matrix: SX) -> SX:
    """Upper triangle of a symmetric matrix, row by row."""
    size = matrix.shape[0]
    return ca.vertcat(*[matrix[i, k] for i in range(size) for k in range(i, size)])
