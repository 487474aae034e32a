"""Device files of arms: what `serial_arm`, `moved_arm`, `arm_drive` and `joint_trajectory` need."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from .tree import Arm, Joint

COMPONENTS = ("serial_arm", "moved_arm", "arm_drive", "joint_trajectory")
POSES = 200
"""Random poses in which the largest inertia of each joint is looked for."""
BANDWIDTH = 2 * math.pi * 5.0
"""Of the position servos [rad/s]: slow against the exchange every millisecond."""
SPRING = 2 * math.pi * 20.0
"""Of the elastic gears, with the links behind them [rad/s]."""
ROTOR = 0.1
"""Inertia of a geared rotor over the largest of its joint; a UR5's is 0.2 to 5."""
LINE = 0.025
"""Distance of the frequencies of an excitation [Hz]; it takes 40 s."""
FAST = 0.7
"""Share of a joint's largest speed that an excitation may reach."""
SMOOTH = 0.05
"""Speed below which Coulomb friction fades [rad/s]: servos and links exchange every millisecond."""
NO_LIMIT = 1e6
"""Torque [N.m] or force [N] that no arm reaches."""


def home(arm: Arm) -> list[float]:
    """The middle of each joint's range, 0 without limits."""
    return [
        (joint.lower + joint.upper) / 2
        if math.isfinite(joint.lower) and math.isfinite(joint.upper)
        else min(max(0.0, joint.lower), joint.upper)
        for joint in arm.joints
    ]


def largest_inertias(arm: Arm) -> list[float]:
    """Largest diagonal of the inertia matrix over random poses within the limits."""
    random = np.random.default_rng(0)
    low, high = _range(arm.joints)
    diagonals = [np.diag(arm.inertia_matrix(random.uniform(low, high))) for _ in range(POSES)]
    return [float(f"{value:.4g}") for value in np.max(diagonals, axis=0)]


def _range(joints: Sequence[Joint]) -> tuple[Any, Any]:
    """Limits, within one turn or a metre where there are none."""
    reach = [1.0 if joint.kind == "prismatic" else math.pi for joint in joints]
    low = [
        max(j.lower, -r) if j.upper > -r else j.lower for j, r in zip(joints, reach, strict=True)
    ]
    high = [min(j.upper, max(r, lo)) for j, r, lo in zip(joints, reach, low, strict=True)]
    return np.array(low), np.array(high)


def swings(arm: Arm) -> list[float]:
    """Amplitudes about `home`: at most 1 rad or 0.3 m, a third of the range, and `FAST`.

    Those of `multisine` with a distance of `LINE` between its frequencies; slower paths take the
    same.
    """
    found = []
    for k, joint in enumerate(arm.joints, 1):
        rate = 2 * math.pi * LINE * (k + 2 * len(arm.joints))  # the mean of five frequencies
        most = 0.3 if joint.kind == "prismatic" else 1.0
        found.append(min(most, 0.35 * (joint.upper - joint.lower), FAST * joint.speed / rate))
    return [float(f"{value:.3g}") for value in found]


def text(arm: Arm, source: str) -> str:
    """The device file.

    Args:
        arm: the chain.
        source: where it comes from, for the `origin` of each value.
    """
    slides = [joint.kind == "prismatic" for joint in arm.joints]
    inertias = [value or 1.0 for value in largest_inertias(arm)]
    middle, swing = home(arm), swings(arm)
    rotors = [j.armature or ROTOR * m for j, m in zip(arm.joints, inertias, strict=True)]
    moved = [m + r for m, r in zip(inertias, rotors, strict=True)]
    names = ", ".join(f"{k + 1} {joint.name}" for k, joint in enumerate(arm.joints))
    out = [
        f"# {arm.name}: serial arm from {arm.base} to {arm.tip}. Written by `cosim arm import`.",
        f"# Joints: {names}.",
        *(f"# {note}." for note in arm.notes),
        "# Values may be changed: FMUs are built anew when this file differs.",
        f"components = {_listed(COMPONENTS)}",
        "",
    ]

    def add(
        name: str, value: Iterable[Any], unit: str, comment: str, *,
        along: str = "", origin: str = source, assumed: bool = False,
    ) -> None:  # fmt: skip
        units = [along if flag else unit for flag in slides]
        shown = f'"{unit}"' if not along or not any(slides) else _listed(units)
        out.extend([f"# {comment}", f"[{name}]", f"value = {_numbers(value)}", f"unit = {shown}"])
        out.append(f"origin = {_text(origin)}")
        out.extend(["assumed = true", ""] if assumed else [""])

    turns = [pose.rotation.ravel() for pose in arm.poses]
    add("rotation", turns, "1", "Axes of each frame at q = 0 in its predecessor's, 3x3 row by row; "
        "z is the joint's axis, the last frame is the tip.")  # fmt: skip
    add("offset", [pose.position for pose in arm.poses], "m", "Origins in the predecessor's frame.")
    add(
        "prismatic",
        [float(flag) for flag in slides],
        "1",
        "1 where a joint slides, 0 where it turns.",
    )
    bodies = arm.bodies
    add("mass", [body.mass for body in bodies], "kg", "What each joint carries up to the next.")
    add("centre", [body.centre for body in bodies], "m", "Centres of mass in the joint's frame.")
    about = [[body.inertia[k] for k in _ELEMENTS] for body in bodies]
    add("inertia", about, "kg.m2", "Ixx, Iyy, Izz, Ixy, Ixz, Iyz about the centre of mass.")
    add("q_min", [j.lower for j in arm.joints], "rad", "Lower limits of the joints.", along="m")
    add("q_max", [j.upper for j in arm.joints], "rad", "Upper limits of the joints.", along="m")
    add("speed_max", [j.speed for j in arm.joints], "rad/s", "Limits of the speeds.", along="m/s")
    add("tau_max", [min(j.effort, NO_LIMIT) for j in arm.joints], "N.m",
        "Limits of the torques; 1e6 where the file has none.", along="N")  # fmt: skip
    add("F_v", [j.damping for j in arm.joints], "N.m.s/rad",
        "Viscous friction, of `arm_drive` and `moved_arm`.",
        along="N.s/m")  # fmt: skip
    add("F_c", [j.friction for j in arm.joints], "N.m", "Coulomb friction, of the same.",
        along="N")  # fmt: skip

    made = "computed by cosim arm import"
    out += ["# Speed over which the sign of the Coulomb friction is smoothed.", "[w_0]",
            f"value = {SMOOTH}", 'unit = "rad/s"', f"origin = {_text(made)}", "assumed = true",
            ""]  # fmt: skip
    add("angle", middle, "rad", "Start of `serial_arm`: the middle of each range.", along="m",
        origin=made)  # fmt: skip
    add("J_link", inertias, "kg.m2",
        f"For `kinematic`: largest inertias of the joints in {POSES} random poses.",
        along="kg", origin=made)  # fmt: skip
    add("serial_arm.K", [SPRING**2 * m for m in inertias], "N.m/rad",
        "For `elastic`: 20 Hz of the whole arm.",
        along="N/m", origin=made, assumed=True)  # fmt: skip
    add("serial_arm.D", [0.1 * SPRING * m for m in inertias], "N.m.s/rad",
        "For `elastic`: a twentieth of critical damping.", along="N.s/m",
        origin=made, assumed=True)  # fmt: skip
    given = all(j.armature for j in arm.joints)
    add("J_rotor", rotors, "kg.m2", "Rotors of `arm_drive`, seen at the joints" + (
        "." if given else ": a tenth of the links', which the file does not tell."),
        along="kg", origin=source if given else made, assumed=not given)  # fmt: skip
    add("k", [BANDWIDTH**2 * m for m in moved], "N.m/rad", "Servos of `arm_drive`: 5 Hz.",
        along="N/m", origin=made, assumed=True)  # fmt: skip
    add("d", [2 * BANDWIDTH * m for m in moved], "N.m.s/rad", "Servos: critical damping.",
        along="N.s/m", origin=made, assumed=True)  # fmt: skip
    add("k_i", [0.2 * BANDWIDTH**3 * m for m in moved], "N.m/(rad.s)",
        "Servos: integral part, a tenth of what would be unstable.",
        along="N/(m.s)", origin=made, assumed=True)  # fmt: skip
    holding = [
        min(max(torque, -j.effort), j.effort)
        for j, torque in zip(arm.joints, arm.gravity_torques(middle), strict=True)
    ]
    add("integral", holding, "N.m", "Servos: integral part at the start, which holds the arm.",
        along="N", origin=made)  # fmt: skip
    add("q_hold", middle, "rad", "Paths of `joint_trajectory` about the middle of each range.",
        along="m", origin=made, assumed=True)  # fmt: skip
    add("amplitude", swing, "rad", "`swing` and `multisine` about it.",
        along="m", origin=made, assumed=True)  # fmt: skip
    out += ["# Distance of the frequencies of `multisine`: joints stay below seven tenths of their",
            "# largest speeds.", "[joint_trajectory.f]", f"value = {LINE}", 'unit = "Hz"',
            f"origin = {_text(made)}", "assumed = true", ""]  # fmt: skip
    add("q_start", middle, "rad", "`quintic` from here.", along="m", origin=made, assumed=True)
    add("q_end", [a + b for a, b in zip(middle, swing, strict=True)], "rad", "`quintic` to here.",
        along="m", origin=made, assumed=True)  # fmt: skip
    return "\n".join(" ".join(line.splitlines()) if line[:1] == "#" else line for line in out)


_ELEMENTS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def _listed(items: Iterable[str]) -> str:
    return "[" + ", ".join(map(_text, items)) + "]"


def _text(value: str) -> str:
    """A text of TOML, which takes JSON's escapes."""
    return json.dumps(value, ensure_ascii=False)


def _number(value: float) -> str:
    value = float(value) + 0.0  # no -0.0
    return repr(value)


def _numbers(values: Iterable[Any]) -> str:
    rows = list(values)
    if rows and not isinstance(rows[0], (int, float)):
        inner = [", ".join(_number(value) for value in row) for row in rows]
        return "[\n" + "".join(f"  [{line}],\n" for line in inner) + "]"
    return "[" + ", ".join(_number(value) for value in rows) + "]"
