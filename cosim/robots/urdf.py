"""URDF: links and joints of a robot, without pictures, collisions and transmissions."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, within
from .numbers import finite, numbers, unit_vector
from .tree import Inertial, Joint, Pose, Tree

KINDS = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "fixed": "fixed",
}


def tree(root: ET.Element, shown: str) -> Tree:
    """Links and joints of a parsed URDF.

    Args:
        root: `<robot>`.
        shown: what error texts call the file.

    Raises:
        InputError: something is missing or no number, two things have one name, a joint names a
            link that is not there.
    """
    with within(shown):
        if "xacro" in "".join(map(str, root.attrib)) or any("xacro" in e.tag for e in root.iter()):
            raise InputError(
                "is a xacro file; expand it first: xacro robot.urdf.xacro > robot.urdf"
            )
        links: dict[str, Inertial | None] = {}
        for element in root.findall("link"):
            name = _name(element, links)
            links[name] = _inertial(name, element.find("inertial"))
        joints: dict[str, Joint] = {}
        for element in root.findall("joint"):
            name = _name(element, joints)
            joints[name] = _joint(name, element, links)
        if not links:
            raise InputError("has no <link>; a URDF has links and joints")
        return Tree(root.get("name", Path(shown).stem), links, tuple(joints.values()))


def _name(element: ET.Element, known: Any) -> str:
    name = element.get("name", "")
    if not name:
        raise InputError(f"a <{element.tag}> has no name")
    if name in known:
        raise InputError(f"two <{element.tag}> have the name {name!r}")
    return name


def rpy(angles: Any) -> Any:
    """Rotation matrix of roll, pitch and yaw: about fixed x, then y, then z."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in angles)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _origin(where: str, element: ET.Element | None) -> Pose:
    if element is None:
        return Pose()
    return Pose(
        rpy(numbers(where, "rpy", element.get("rpy", "0 0 0"), 3)),
        numbers(where, "xyz", element.get("xyz", "0 0 0"), 3),
    )


def _inertial(link: str, element: ET.Element | None) -> Inertial | None:
    if element is None:
        return None
    where = f"link {link!r}"
    mass, inertia = element.find("mass"), element.find("inertia")
    if mass is None or inertia is None:
        missing = "mass" if mass is None else "inertia"
        raise InputError(f"{where}: its <inertial> has no <{missing}>")
    xx, xy, xz, yy, yz, zz = (
        finite(where, key, inertia.get(key, "0" if key in ("ixy", "ixz", "iyz") else ""))
        for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    pose = _origin(where, element.find("origin"))
    about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    turned = pose.rotation @ about @ pose.rotation.T
    return Inertial(finite(where, "mass", mass.get("value", "")), pose.position, turned)


def _refuse_negative(where: str, key: str, value: float) -> None:
    if value < 0.0:
        raise InputError(f"{where}: its {key} is {value:g}; it must not be negative")


def _loss(where: str, key: str, dynamics: ET.Element | None) -> float:
    value = 0.0 if dynamics is None else finite(where, key, dynamics.get(key, "0"))
    _refuse_negative(where, key, value)
    return value


def _joint(name: str, element: ET.Element, links: Any) -> Joint:
    where = f"joint {name!r}"
    kind = element.get("type", "")
    ends = []
    for tag in ("parent", "child"):
        end = element.find(tag)
        link = "" if end is None else end.get("link", "")
        if link not in links:
            raise InputError(f"{where}: its {tag} {link!r} is no link of the file")
        ends.append(link)
    axis = element.find("axis")
    moves = KINDS.get(kind, kind) != "fixed"
    limits: dict[str, float] = {}
    limit = element.find("limit")
    if limit is not None:
        for key in ("lower", "upper", "effort", "velocity"):
            if limit.get(key) is not None and not (
                kind == "continuous" and key in ("lower", "upper")
            ):
                limits[key] = finite(where, key, limit.get(key, ""))
        if {"lower", "upper"} & set(limits):  # one of them alone: the other is 0
            limits = {"lower": 0.0, "upper": 0.0} | limits
    for key in ("effort", "velocity"):
        _refuse_negative(where, key, limits.get(key, 0.0))
    if limits.get("lower", -math.inf) > limits.get("upper", math.inf):
        raise InputError(
            f"{where}: its lower limit {limits['lower']:g} lies above its upper limit "
            f"{limits['upper']:g}"
        )
    dynamics = element.find("dynamics")
    mimic = element.find("mimic")
    return Joint(
        name,
        KINDS.get(kind, kind),
        ends[0],
        ends[1],
        _origin(where, element.find("origin")),
        unit_vector(where, "1 0 0" if axis is None else axis.get("xyz", "1 0 0"))
        if moves
        else np.array([0.0, 0.0, 1.0]),
        lower=limits.get("lower", -math.inf),
        upper=limits.get("upper", math.inf),
        effort=limits.get("effort", 0.0) or math.inf,  # 0: files whose author knew none
        speed=limits.get("velocity", 0.0) or math.inf,
        damping=_loss(where, "damping", dynamics),
        friction=_loss(where, "friction", dynamics),
        mimics="" if mimic is None else mimic.get("joint", "?"),
    )
