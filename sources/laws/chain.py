"""Links of a serial chain: mass properties, joints and the geometry between them.

Link `i` carries a frame whose z axis is joint axis `i` and whose origin lies on it. A revolute
joint turns it by `q_i` about that axis, a prismatic one moves it by `q_i` along it. (With standard
Denavit-Hartenberg data: frame i-1, turned by `q_i`.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

SX = Any


@dataclass(frozen=True)
class Link:
    """A link and the joint before it.

    Attributes:
        rotation: axes of the link at `q = 0` in the axes of the predecessor (3x3).
        offset: its origin at `q = 0` in the predecessor's frame [m].
        mass: [kg].
        first_moment: mass times centre of mass [kg.m].
        inertia: about the frame's origin [kg.m2] (3x3).
        prismatic: it slides along its axis instead of turning about it.
    """

    rotation: SX
    offset: SX
    mass: SX
    first_moment: SX
    inertia: SX
    prismatic: bool = False


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
    J = symmetric(turn @ ca.SX(inertia) @ turn.T)
    link = replace(
        last,
        mass=last.mass + mass,
        first_moment=last.first_moment + (h + mass * shift),
        inertia=last.inertia + (J + shifted(mass, h, shift)),
    )
    return replace(chain, links=(*chain.links[:-1], link))


def shifted(m: SX, h: SX, r: SX) -> SX:
    """What an inertia gains when its reference point moves by -r (h: first moment before)."""
    return symmetric(
        (2 * ca.dot(r, h) + m * ca.dot(r, r)) * ca.SX.eye(3) - r @ h.T - h @ r.T - m * (r @ r.T)
    )


def symmetric(matrix: SX) -> SX:
    """The upper triangle mirrored: the lower one is never computed."""
    return ca.triu2symm(ca.triu(matrix))


def skew(v: SX) -> SX:
    """Matrix of the cross product, `skew(v) @ w = v x w`."""
    return ca.skew(v)


def free_axes(
    rotation: Sequence[Sequence[float]],
    offset: Sequence[Sequence[float]],
    prismatic: Sequence[float],
    mass: Sequence[SX],
    first_moment: Sequence[Sequence[SX]],
    inertia: Sequence[Sequence[SX]],
) -> Chain:
    """Chain whose joints lie anywhere: one frame per joint, and one more for the flange.

    Args:
        rotation: axes of frame i at q = 0 in axes of its predecessor, 3x3 row by row.
        offset: origins in the predecessor's frame [m].
        prismatic: per joint 1 if it slides along z, 0 if it turns about z.
        mass: masses [kg].
        first_moment: masses times centres of mass, frame i [kg.m].
        inertia: (Ixx, Iyy, Izz, Ixy, Ixz, Iyz) about the origin of frame i, its axes [kg.m2].
    """
    turns = [ca.SX(np.reshape(row, (3, 3))) for row in rotation]
    shifts = [ca.SX(np.asarray(row, dtype=float)) for row in offset]
    links = tuple(
        Link(
            turns[i],
            shifts[i],
            ca.SX(mass[i]),
            ca.vertcat(*first_moment[i]),
            full_inertia(inertia[i]),
            bool(prismatic[i]),
        )
        for i in range(len(mass))
    )
    return Chain(links, turns[-1], shifts[-1])


def full_inertia(elements: Sequence[SX]) -> SX:
    """3x3 from (Ixx, Iyy, Izz, Ixy, Ixz, Iyz)."""
    xx, yy, zz, xy, xz, yz = elements
    return ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))


def quaternion_of(rotation: Any) -> Any:
    """Quaternion w x y z of a rotation matrix of numbers, from its largest element."""
    r = np.asarray(rotation, dtype=float)
    outer = np.array(
        [
            [
                1 + r[0, 0] + r[1, 1] + r[2, 2],
                r[2, 1] - r[1, 2],
                r[0, 2] - r[2, 0],
                r[1, 0] - r[0, 1],
            ],
            [0, 1 + r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
            [0, 0, 1 - r[0, 0] + r[1, 1] - r[2, 2], r[1, 2] + r[2, 1]],
            [0, 0, 0, 1 - r[0, 0] - r[1, 1] + r[2, 2]],
        ]
    )
    outer = outer + np.triu(outer, 1).T  # 4 q q^T
    row = outer[int(np.argmax(np.diag(outer)))]
    return row / np.linalg.norm(row)
