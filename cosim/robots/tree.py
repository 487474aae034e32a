"""What URDF and MJCF have in common: a tree of bodies with joints, and the serial chain in it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..errors import InputError, UnknownNameError, listing

Matrix = Any
NOTHING = 1e-12
"""How far rounding takes elements of a rotation off 0 and 1 where angles are right."""
MOVING = ("revolute", "prismatic")


@dataclass(frozen=True)
class Pose:
    """Rotation and position of a frame in another."""

    rotation: Matrix = field(default_factory=lambda: np.eye(3))
    position: Matrix = field(default_factory=lambda: np.zeros(3))

    def __matmul__(self, other: Pose) -> Pose:
        return Pose(self.rotation @ other.rotation, self.position + self.rotation @ other.position)


@dataclass(frozen=True)
class Inertial:
    """Mass [kg], centre of mass [m] and inertia about it [kg.m2], all in the link's frame."""

    mass: float
    centre: Matrix
    inertia: Matrix

    def moved(self, pose: Pose) -> Inertial:
        """The same body in the axes of a frame in which its own has this pose."""
        turn = pose.rotation
        return Inertial(self.mass, pose.position + turn @ self.centre, turn @ self.inertia @ turn.T)

    def __add__(self, other: Inertial) -> Inertial:
        mass = self.mass + other.mass
        if mass == 0.0:
            return Inertial(0.0, np.zeros(3), self.inertia + other.inertia)
        centre = (self.mass * self.centre + other.mass * other.centre) / mass
        inertia = self.inertia + other.inertia
        for part in (self, other):
            d = part.centre - centre
            inertia = inertia + part.mass * (d @ d * np.eye(3) - np.outer(d, d))
        return Inertial(mass, centre, inertia)


EMPTY = Inertial(0.0, np.zeros(3), np.zeros((3, 3)))


@dataclass(frozen=True)
class Joint:
    """A joint between two links.

    Attributes:
        name: of the joint.
        kind: `revolute` (limited or not), `prismatic`, `fixed`, or another that no chain may have.
        parent, child: links.
        pose: of the child at position 0 in the parent.
        axis: unit vector in the child's axes.
        at: origin of the joint in the child's frame (0 in URDF).
        lower, upper: limits of the position, infinite without.
        effort, speed: limits, infinite without.
        damping, friction: viscous and Coulomb.
        armature: inertia of the rotor, seen at the joint.
        mimics: joint that it follows, "" if it is free.
    """

    name: str
    kind: str
    parent: str
    child: str
    pose: Pose
    axis: Matrix
    at: Matrix = field(default_factory=lambda: np.zeros(3))
    lower: float = -math.inf
    upper: float = math.inf
    effort: float = math.inf
    speed: float = math.inf
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    mimics: str = ""


@dataclass(frozen=True)
class Tree:
    """Links and joints of a file.

    Attributes:
        name: of the robot.
        links: name -> mass properties, None where the file gives none.
        joints: in the file's order.
        lacking: what a link without mass properties lacks in this kind of file.
    """

    name: str
    links: Mapping[str, Inertial | None]
    joints: tuple[Joint, ...]
    lacking: str = "has no <inertial>"

    def root(self) -> str:
        """The link that no joint carries.

        Raises:
            InputError: there are several, or none, or a link hangs on two joints.
        """
        carried: dict[str, str] = {}
        for joint in self.joints:
            if joint.child in carried:
                raise InputError(
                    f"link {joint.child!r} hangs on two joints, {carried[joint.child]!r} and "
                    f"{joint.name!r}: a closed loop is no serial chain"
                )
            carried[joint.child] = joint.name
        roots = [link for link in self.links if link not in carried]
        if len(roots) != 1:
            raise InputError(
                f"{len(roots)} links hang on no joint ({', '.join(roots) or 'a closed loop'}); "
                "a robot has one"
            )
        return roots[0]

    def children(self, link: str) -> list[Joint]:
        """Joints that a link carries."""
        return [joint for joint in self.joints if joint.parent == link]

    def beyond(self, link: str) -> Iterator[Joint]:
        """All joints in the subtree of a link."""
        for joint in self.children(link):
            yield joint
            yield from self.beyond(joint.child)

    def path(self, base: str, tip: str) -> list[Joint]:
        """Joints from base to tip.

        Raises:
            InputError: the tip does not hang on the base.
        """
        above = {joint.child: joint for joint in self.joints}
        found: list[Joint] = []
        link = tip
        while link != base:
            if link not in above or len(found) > len(self.joints):  # no joint, or a ring of them
                raise InputError(f"link {tip!r} does not hang on {base!r}; choose another --tip")
            found.append(above[link])
            link = above[link].parent
        return found[::-1]


@dataclass(frozen=True)
class Arm:
    """A serial chain: one frame per joint whose z axis is the joint's, and the flange.

    Attributes:
        name: of the robot.
        base, tip: links.
        joints: those that move, from the base.
        poses: of each joint's frame at position 0 in its predecessor's, and of the tip in the last.
        bodies: what each joint carries up to the next, in the joint's frame.
        notes: what the reader had to decide, one sentence each.
    """

    name: str
    base: str
    tip: str
    joints: tuple[Joint, ...]
    poses: tuple[Pose, ...]
    bodies: tuple[Inertial, ...]
    notes: tuple[str, ...]

    def massless(self) -> str:
        """First joint beyond which nothing has mass or inertia, "" without one."""
        for joint, beyond in zip(self.joints, range(len(self.bodies)), strict=True):
            if all(b.mass == 0.0 and not b.inertia.any() for b in self.bodies[beyond:]):
                return joint.name
        return ""

    def inertia_matrix(self, q: Sequence[float]) -> Matrix:
        """Joint inertia matrix [kg.m2, kg.m, kg] at joint positions."""
        matrix = np.zeros((len(self.joints), len(self.joints)))
        for body, linear, angular, turn in self._jacobians(q):
            inertia = turn @ body.inertia @ turn.T
            matrix += body.mass * linear.T @ linear + angular.T @ inertia @ angular
        return matrix

    def gravity_torques(self, q: Sequence[float], gravity: float = 9.81) -> Matrix:
        """Torques [N.m] and forces [N] that hold the arm on a level mount at joint positions."""
        torques = np.zeros(len(self.joints))
        for body, linear, _, _ in self._jacobians(q):
            torques += body.mass * gravity * linear[2]
        return torques

    def _jacobians(self, q: Sequence[float]) -> Iterator[tuple[Inertial, Matrix, Matrix, Matrix]]:
        """Each body with the Jacobians of its centre and its rotation, and its axes; mount axes."""
        size = len(self.joints)
        pose, axes = Pose(), []
        for i, (joint, body) in enumerate(zip(self.joints, self.bodies, strict=True)):
            pose = pose @ self.poses[i]
            axes.append((pose.rotation[:, 2], pose.position, joint.kind == "prismatic"))
            pose = pose @ displaced(joint.kind, q[i])
            centre = pose.position + pose.rotation @ body.centre
            linear, angular = np.zeros((3, size)), np.zeros((3, size))
            for k, (z, origin, slides) in enumerate(axes):
                if slides:
                    linear[:, k] = z
                else:
                    linear[:, k], angular[:, k] = np.cross(z, centre - origin), z
            yield body, linear, angular, pose.rotation


def displaced(kind: str, q: float) -> Pose:
    """Pose of a frame that a joint has moved along or about its z axis."""
    if kind == "prismatic":
        return Pose(position=np.array([0.0, 0.0, q]))
    c, s = math.cos(q), math.sin(q)
    return Pose(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))


def serial(tree: Tree, base: str = "", tip: str = "") -> Arm:
    """The serial chain from base to tip, bodies that do not move against each other merged.

    Args:
        base: link on which the chain stands, the file's root by default.
        tip: link of the flange, by default the last one of a chain without branches.

    Raises:
        UnknownNameError: a link that is not there.
        InputError: branches without a tip, closed loops, mimic or other joints in the chain,
            no joint at all.
    """
    root = tree.root()
    for option, link in (("--base", base), ("--tip", tip)):
        if link and link not in tree.links:
            raise UnknownNameError(
                f"{option}: there is no link {link!r}; {listing(tree.links, link)}"
            )
    base = base or root
    tip = tip or _last(tree, base)
    path = tree.path(base, tip)
    chain = [_usable(joint) for joint in path if joint.kind != "fixed"]
    if not chain:
        raise InputError(f"no joint moves between {base!r} and {tip!r}; nothing is left of an arm")
    notes: list[str] = []
    on_chain = {joint.child for joint in path} | {base}
    poses, bodies = [], []
    pose, first = Pose(), True
    body, turn = EMPTY, Pose()
    for joint in path:
        pose = pose @ joint.pose
        if joint.kind != "fixed":
            if not first:
                bodies.append(body)
            first = False
            turn = Pose(_onto(joint.axis), joint.at)
            poses.append(_clean(pose @ turn))
            # from here on everything is seen from the joint's frame
            pose = Pose(turn.rotation.T, -turn.rotation.T @ joint.at)
            body = EMPTY
        if not first:
            body = body + _collected(tree, joint.child, pose, on_chain, notes)
    bodies.append(body)
    poses.append(_clean(pose))
    _note_base(tree, base, path, on_chain, notes)
    return Arm(tree.name, base, tip, tuple(chain), tuple(poses), tuple(bodies), tuple(notes))


def _last(tree: Tree, base: str) -> str:
    """The end of a chain without branches of moving joints."""
    link = base
    while True:
        children = tree.children(link)
        moving = [
            joint
            for joint in children
            if joint.kind != "fixed" or any(j.kind != "fixed" for j in tree.beyond(joint.child))
        ]
        if len(moving) > 1:
            names = " and ".join(repr(joint.name) for joint in moving)
            ends = [link, *sorted({_end(tree, joint.child) for joint in moving} - {link})]
            raise InputError(
                f"the robot branches at link {link!r} into {names}: a serial chain has one way; "
                f"name its end with --tip, e.g. {', '.join(ends)}"
            )
        following = moving or (children if len(children) == 1 else [])
        if not following:
            return link
        link = following[0].child


def _end(tree: Tree, link: str) -> str:
    while children := tree.children(link):
        link = children[0].child
    return link


def _usable(joint: Joint) -> Joint:
    if joint.mimics:
        raise InputError(
            f"joint {joint.name!r} of the chain mimics {joint.mimics!r}; joints that depend on "
            "each other are no serial chain: end it before with --tip, or make the joint fixed"
        )
    if joint.kind not in MOVING:
        raise InputError(
            f"joint {joint.name!r} of the chain is of type {joint.kind!r}; an arm has revolute, "
            "continuous, prismatic and fixed joints"
        )
    return joint


def _collected(tree: Tree, link: str, pose: Pose, on_chain: set[str], notes: list[str]) -> Inertial:
    """A link and all that hangs on it beside the chain, locked at position 0."""
    own = tree.links[link]
    if own is None:
        total = EMPTY
        notes.append(f"link {link!r} {tree.lacking}: it counts as massless")
    else:
        _check_body(link, own, notes)
        total = own.moved(pose)
    for joint in tree.children(link):
        if joint.child in on_chain:
            continue
        if joint.kind != "fixed":
            notes.append(
                f"joint {joint.name!r} lies beside the chain: it is locked at 0, and its link "
                f"{joint.child!r} is merged with {link!r}"
            )
        total = total + _collected(tree, joint.child, pose @ joint.pose, on_chain, notes)
    return total


def _check_body(link: str, body: Inertial, notes: list[str]) -> None:
    """Raise InputError or note what no real body has."""
    if body.mass < 0.0:
        raise InputError(f"link {link!r} has the mass {body.mass:g} kg; a mass is not negative")
    moments = np.linalg.eigvalsh(body.inertia)
    # rounding of printed inertias: a flat body fulfils the triangle inequality exactly
    if moments[0] < 0.0 or moments[2] > (moments[0] + moments[1]) * (1.0 + 1e-3):
        shown = ", ".join(f"{value:.4g}" for value in moments)
        notes.append(
            f"link {link!r}: principal moments of inertia {shown} kg.m2 belong to no real body "
            "(none is negative, and none exceeds the sum of the other two)"
        )


def _note_base(
    tree: Tree, base: str, path: Sequence[Joint], on_chain: set[str], notes: list[str]
) -> None:
    links = [base]
    for joint in path:
        if joint.kind != "fixed":
            break
        links.append(joint.child)
    masses = [tree.links[link] for link in links]
    total = sum(body.mass for body in masses if body is not None)
    if total:
        these = "does not move: it belongs" if len(links) == 1 else "do not move: they belong"
        notes.append(f"{' and '.join(links)} ({total:.4g} kg) {these} to the mount, not to the arm")


def _onto(axis: Matrix) -> Matrix:
    """The shortest rotation that turns z onto an axis; exact where axes are parallel."""
    x, y, z = axis
    if z < -1.0 + NOTHING:
        return np.diag([1.0, -1.0, -1.0])
    v = np.array([[0.0, 0.0, x], [0.0, 0.0, y], [-x, -y, 0.0]])  # of z cross axis
    return np.eye(3) + v + v @ v / (1.0 + z)


def _clean(pose: Pose) -> Pose:
    """Elements of a rotation that rounding took off 0, 1 and -1 put back."""
    turn = pose.rotation.copy()
    for whole in (-1.0, 0.0, 1.0):
        turn[np.abs(turn - whole) < NOTHING] = whole
    return replace(pose, rotation=turn)
