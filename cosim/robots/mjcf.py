"""MJCF, MuJoCo's description of bodies and joints, as far as a serial arm needs it.

Read: bodies with their poses in all notations, hinge and slide joints with defaults, inertials,
`compiler` options for angles. Inertias that MuJoCo would take from geoms are not computed.

Source: MuJoCo documentation, XML reference.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, within
from .numbers import finite, numbers, unit_vector
from .tree import Inertial, Joint, Pose, Tree

WORLD = "world"
KINDS = {"hinge": "revolute", "slide": "prismatic"}
ORIENTATIONS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")


@dataclass(frozen=True)
class _Settings:
    """What `compiler` and `default` say."""

    degrees: bool
    sequence: str
    limited_by_range: bool
    defaults: Mapping[str, Mapping[str, str]]

    def angle(self, value: float) -> float:
        return math.radians(value) if self.degrees else value


def tree(root: ET.Element, shown: str) -> Tree:
    """Bodies and joints of a parsed MJCF.

    Args:
        root: `<mujoco>`.
        shown: what error texts call the file.

    Raises:
        InputError: something is missing or no number, names are used twice, loops are closed, or
            the file includes others.
    """
    with within(shown):
        if root.find(".//include") is not None:
            raise InputError(
                "includes other files; save it as one (mj_saveLastXML, or MuJoCo's compile tool)"
            )
        world = root.find("worldbody")
        if world is None:
            raise InputError("has no <worldbody>; an MJCF has its bodies there")
        compiler = root.find("compiler")
        given = {} if compiler is None else dict(compiler.attrib)
        if given.get("coordinate", "local") != "local":
            raise InputError('has coordinate="global", which MuJoCo has given up; convert the file')
        settings = _Settings(
            given.get("angle", "degree") == "degree",
            given.get("eulerseq", "xyz"),
            given.get("autolimits", "true") == "true",
            _defaults(root),
        )
        links: dict[str, Inertial | None] = {WORLD: Inertial(0.0, np.zeros(3), np.zeros((3, 3)))}
        joints: list[Joint] = []
        for body in world.findall("body"):
            _read_body(body, WORLD, "", settings, links, joints)
        return Tree(
            root.get("model", Path(shown).stem),
            links,
            tuple(_coupled(root, joints)),
            "has no <inertial> (those of geoms are not computed)",
        )


def _defaults(root: ET.Element) -> dict[str, dict[str, str]]:
    """Attributes of joints by class, what outer classes say included."""
    found: dict[str, dict[str, str]] = {"": {}}

    def collect(element: ET.Element, inherited: dict[str, str], name: str) -> None:
        joint = element.find("joint")
        own = {**inherited, **({} if joint is None else joint.attrib)}
        found[name] = own
        for inner in element.findall("default"):
            collect(inner, own, inner.get("class", ""))

    for element in root.findall("default"):
        collect(element, {}, element.get("class", "main"))
        found[""] = found[element.get("class", "main")]
    return found


def _read_body(
    element: ET.Element,
    parent: str,
    childclass: str,
    settings: _Settings,
    links: dict[str, Inertial | None],
    joints: list[Joint],
) -> None:
    name = element.get("name", "") or f"body_{len(links)}"
    if name in links:
        raise InputError(f"two bodies have the name {name!r}")
    childclass = element.get("childclass", childclass)
    where = f"body {name!r}"
    pose = _pose(where, element, settings)
    if element.find("freejoint") is not None:
        raise InputError(
            f"{where} has a <freejoint>: it stands on nothing; an arm is fixed to the world (take "
            "the joint out)"
        )
    inertial = element.find("inertial")
    links[name] = None if inertial is None else _inertial(where, inertial, settings)
    moving = element.findall("joint")
    own = [_joint(where, item, childclass, settings) for item in moving]
    if not own:
        own = [Joint(f"fixed_{name}", "fixed", "", "", Pose(), np.array([0.0, 0.0, 1.0]))]
    # several joints of one body: massless bodies between them, in the same pose
    for k, joint in enumerate(own):
        last = k == len(own) - 1
        child = name if last else f"{name}_{k + 1}"
        if not last:
            links[child] = Inertial(0.0, np.zeros(3), np.zeros((3, 3)))
        if any(each.name == joint.name for each in joints):
            raise InputError(f"two joints have the name {joint.name!r}")
        joints.append(replace(joint, parent=parent, child=child, pose=pose))
        parent, pose = child, Pose()
    for inner in element.findall("body"):
        _read_body(inner, name, childclass, settings, links, joints)


def _joint(where: str, element: ET.Element, childclass: str, settings: _Settings) -> Joint:
    group = element.get("class", childclass)
    if group and group not in settings.defaults:
        raise InputError(f"{where}: there is no default class {group!r}")
    given = {**settings.defaults[group], **element.attrib}
    name = given.get("name", "") or f"joint of {where}"
    what = f"joint {name!r}"
    kind = given.get("type", "hinge")
    sliding = kind == "slide"
    lower, upper = -math.inf, math.inf
    limited = given.get("limited", "auto")
    if "range" in given and (
        limited == "true" or (limited == "auto" and settings.limited_by_range)
    ):
        low, high = numbers(what, "range", given["range"], 2)
        lower, upper = (
            (float(low), float(high)) if sliding else (settings.angle(low), settings.angle(high))
        )
    effort = math.inf
    if "actuatorfrcrange" in given:
        effort = float(
            np.max(np.abs(numbers(what, "actuatorfrcrange", given["actuatorfrcrange"], 2)))
        )
    if finite(what, "ref", given.get("ref", "0")) != 0.0:
        raise InputError(f"{what} has a ref other than 0, which is not read; turn the body instead")
    return Joint(
        name,
        KINDS.get(kind, kind),
        "",
        "",
        Pose(),
        unit_vector(what, given.get("axis", "0 0 1")),
        at=numbers(what, "pos", given.get("pos", "0 0 0"), 3),
        lower=lower,
        upper=upper,
        effort=effort,
        damping=finite(what, "damping", given.get("damping", "0").split()[0]),
        friction=finite(what, "frictionloss", given.get("frictionloss", "0")),
        armature=finite(what, "armature", given.get("armature", "0")),
    )


def _pose(where: str, element: ET.Element, settings: _Settings) -> Pose:
    return Pose(
        _rotation(where, element, settings),
        numbers(where, "pos", element.get("pos", "0 0 0"), 3),
    )


def _rotation(where: str, element: ET.Element, settings: _Settings) -> Any:
    given = [key for key in ORIENTATIONS if key in element.attrib]
    if not given:
        return np.eye(3)
    key, text = given[0], element.attrib[given[0]]
    if key == "quat":
        return _of_quaternion(where, numbers(where, key, text, 4))
    if key == "axisangle":
        x = numbers(where, key, text, 4)
        return _about(x[:3], settings.angle(float(x[3])))
    if key == "zaxis":
        z = unit_vector(where, text)
        v, c = np.cross([0.0, 0.0, 1.0], z), float(z[2])
        return (
            _about(v, math.atan2(float(np.linalg.norm(v)), c)) if v.any() else np.diag([1.0, c, c])
        )
    if key == "xyaxes":
        six = numbers(where, key, text, 6)
        x = six[:3] / np.linalg.norm(six[:3])
        y = six[3:] - (six[3:] @ x) * x
        y = y / np.linalg.norm(y)
        return np.column_stack([x, y, np.cross(x, y)])
    turn = np.eye(3)
    for axis, value in zip(settings.sequence, numbers(where, key, text, 3), strict=True):
        step = _about(np.eye(3)["xyz".index(axis.lower())], settings.angle(float(value)))
        turn = turn @ step if axis.islower() else step @ turn
    return turn


def _about(axis: Any, angle: float) -> Any:
    """Rotation about an axis of any length but 0 (Rodrigues)."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * (k @ k)


def _of_quaternion(where: str, q: Any) -> Any:
    """Rotation matrix of a quaternion w x y z of any length but 0."""
    length = float(np.linalg.norm(q))
    if length == 0.0:
        raise InputError(f"{where}: its quaternion is 0; it has a length")
    w, x, y, z = q / length
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _inertial(where: str, element: ET.Element, settings: _Settings) -> Inertial:
    pose = _pose(where, element, settings)
    mass = finite(where, "mass", element.get("mass", ""))
    if "fullinertia" in element.attrib:
        xx, yy, zz, xy, xz, yz = numbers(where, "fullinertia", element.attrib["fullinertia"], 6)
        about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    elif "diaginertia" in element.attrib:
        about = np.diag(numbers(where, "diaginertia", element.attrib["diaginertia"], 3))
    else:
        raise InputError(f"{where}: its <inertial> has neither diaginertia nor fullinertia")
    turned = pose.rotation @ about @ pose.rotation.T
    return Inertial(mass, pose.position, turned)


def _coupled(root: ET.Element, joints: list[Joint]) -> list[Joint]:
    """Joints with what `equality` makes of them.

    Raises:
        InputError: two bodies are tied to each other.
    """
    followers: dict[str, str] = {}
    for equality in root.findall("equality"):
        for kind in ("connect", "weld"):
            for tie in equality.findall(kind):
                if tie.get("active", "true") == "true":
                    ends = [tie.get(key, WORLD) for key in ("body1", "body2")]
                    raise InputError(
                        f"<{kind}> ties bodies {ends[0]!r} and {ends[1]!r}: a closed loop is no "
                        "serial chain"
                    )
        for tie in equality.findall("joint"):
            if tie.get("active", "true") == "true" and tie.get("joint2"):
                followers[tie.get("joint1", "")] = tie.get("joint2", "")
    return [replace(joint, mimics=followers.get(joint.name, "")) for joint in joints]
