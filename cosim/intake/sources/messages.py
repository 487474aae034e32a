"""ROS messages as numbers with names and units: fields taken apart, whatever the type.

What a vector measures follows from the field that holds it (`twist.linear` in m/s, `force` in N).
Quaternions become roll, pitch and yaw (rotations about fixed x, y, z, in rad). Joints are taken as
revolute (rad, rad/s, N.m): messages do not say what they are. Left out: covariances, texts, and
lists of more than `LONGEST` numbers (images, scans, clouds).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
LONGEST = 32
"""Numbers of a list that become columns."""
HEAVY = {
    "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/PointCloud2",
    "sensor_msgs/msg/PointCloud", "sensor_msgs/msg/LaserScan", "nav_msgs/msg/OccupancyGrid",
    "nav_msgs/msg/Path", "visualization_msgs/msg/MarkerArray", "visualization_msgs/msg/Marker",
    "rosgraph_msgs/msg/Log", "rcl_interfaces/msg/Log", "rcl_interfaces/msg/ParameterEvent",
    "diagnostic_msgs/msg/DiagnosticArray", "std_msgs/msg/String",
}  # fmt: skip
"""Types that hold no signals: not even opened."""
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
JOINTS = "sensor_msgs/msg/JointState"
_NO_SIGNALS = ("header", "__msgtype__", "layout", "structure_needs_at_least_one_member")
QUATERNION = "geometry_msgs/msg/Quaternion"
TIMES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
_PLAIN = {"pose", "position", "orientation", "twist", "transform", "translation", "rotation",
          "accel", "wrench", "point", "vector", "quaternion", "pose_stamped"}  # fmt: skip
"""Fields that only wrap others: they are no part of a column's name."""
_UNITS = {
    "linear": "m/s", "angular": "rad/s", "position": "m", "translation": "m", "point": "m",
    "force": "N", "torque": "N.m", "angular_velocity": "rad/s", "linear_acceleration": "m/s2",
}  # fmt: skip
"""Unit of a vector by the field that holds it."""
_OF_RATES = {**_UNITS, "linear": "m/s2", "angular": "rad/s2"}
"""In an `ACCEL`, whose fields are called as those of a twist."""
ACCEL = "geometry_msgs/msg/Accel"
_LISTS = {"position": "rad", "velocity": "rad/s", "effort": "N.m"}
CLOCK, FIELD = "time", "time_field"
"""Name of the clock of a topic, and of a field of its messages that is called so."""
PARTS = ("qx", "qy", "qz", "qw")
TURNS = ("roll", "pitch", "yaw")
Path = tuple[str, ...]
"""Fields from a message down to a number."""
Row = dict[Path, float]


def stamp(message: Any) -> int:
    """Time in the header of a message [ns since 1970], -1 if it has no header."""
    header = getattr(message, "header", None)
    return nanoseconds(header.stamp) if header is not None else -1


def nanoseconds(time: Any) -> int:
    """A time of ROS as nanoseconds."""
    return int(time.sec) * 10**9 + int(time.nanosec)


def frames(message: Any) -> str:
    """Frames of a message: `odom -> base_link`, or the one that it names."""
    header = getattr(message, "header", None)
    parent = str(getattr(header, "frame_id", "") or "")
    child = str(getattr(message, "child_frame_id", "") or "")
    return f"{parent} -> {child}" if parent and child else parent or child


def parts(message: Any, kind: str) -> Iterator[tuple[str, Any]]:
    """The messages in a message, each for a topic of its own: transforms by their frames."""
    if kind in TRANSFORMS:
        for item in message.transforms:
            yield f" {item.header.frame_id} -> {item.child_frame_id}", item
    else:
        yield "", message


def numbers(message: Any, kind: str, units: dict[Path, str]) -> Row:
    """The numbers of a message by path; what their units are is put into `units`."""
    row: Row = {}
    if kind == JOINTS:
        for field, unit in _LISTS.items():
            for name, value in zip(message.name, getattr(message, field), strict=False):
                row[(f"{field}.{name}",)] = float(value)
                units[(f"{field}.{name}",)] = unit
        return row
    _take(message, (), row, units)
    return row


def _take(
    value: Any, path: Path, row: Row, units: dict[Path, str],
    usual: Mapping[str, str] = _UNITS,
) -> None:  # fmt: skip
    kind = getattr(value, "__msgtype__", "")
    usual = _OF_RATES if kind == ACCEL else usual
    if kind in TIMES:
        row[path], units[path] = nanoseconds(value) * 1e-9, "s"
    elif kind == QUATERNION:
        if any((value.x, value.y, value.z, value.w)):
            for part, number in zip(PARTS, (value.x, value.y, value.z, value.w), strict=True):
                row[(*path, part)] = float(number)
    elif kind:
        for field in value.__dataclass_fields__:
            if field in _NO_SIGNALS or "covariance" in field:
                continue
            _take(getattr(value, field), (*path, field), row, units, usual)
    elif isinstance(value, (bool, int, float, np.generic)) and not isinstance(value, np.str_):
        row[path] = float(value)
        if unit := _unit(path, usual):
            units[path] = unit
    elif _is_list(value) and len(value) <= LONGEST:
        for index, item in enumerate(value, 1):
            _take(item, (*path[:-1], f"{path[-1]}_{index}"), row, units, usual)


def _is_list(value: Any) -> bool:
    return isinstance(value, (np.ndarray, Sequence)) and not isinstance(value, (str, bytes))


def names(paths: Iterable[Path]) -> dict[Path, str]:
    """A name for each number of a topic's messages.

    Words that only wrap are no part of it, but as many of the last ones as tell two numbers apart:
    `position_x` and `orientation_x` where both are vectors.
    """
    kept = dict.fromkeys(paths, 0)
    while True:
        found = {path: _name(path, count) for path, count in kept.items()}
        times = Counter(found.values())
        alike = [path for path, name in found.items() if times[name] > 1]
        if not alike:
            return found
        for path in alike:
            kept[path] += 1


def _name(path: Path, wrapping: int) -> str:
    """Name of a field, with some of the words that only wrap, or all if nothing else is left."""
    plain = [place for place, field in enumerate(path) if field in _PLAIN]
    if wrapping > len(plain):  # `a_b` beside a `b` in an `a`
        return ".".join(path)
    dropped = plain[: len(plain) - wrapping]
    return "_".join([f for place, f in enumerate(path) if place not in dropped] or path)


def _unit(path: Path, usual: Mapping[str, str]) -> str:
    """Unit of the element of a vector, by the field that holds it."""
    if path[-1] not in ("x", "y", "z") or len(path) < 2:
        # a pose in the plane, or a point alone
        return "m" if path in (("x",), ("y",), ("z",)) else "rad" if path == ("theta",) else ""
    return usual.get(path[-2], "")


def beside_clock(
    columns: dict[str, Vector], units: dict[str, str]
) -> tuple[dict[str, Vector], list[str]]:
    """Columns none of which is called as the clock is; where a unit is known, it goes along.

    Returns:
        The columns, and what is to be said.
    """
    if CLOCK not in columns:
        return columns, []
    if CLOCK in units:
        units[FIELD] = units.pop(CLOCK)
    note = f"the field {CLOCK} of the messages is called {FIELD}: {CLOCK} is the clock"
    return {FIELD if name == CLOCK else name: own for name, own in columns.items()}, [note]


def turned(
    columns: dict[str, Vector], units: dict[str, str]
) -> tuple[dict[str, Vector], list[str]]:
    """Columns with roll, pitch and yaw instead of quaternions; yaw and roll count whole turns.

    Returns:
        The columns, and what is to be said.
    """
    found, notes = dict(columns), []
    for name in list(columns):
        if not name.endswith(PARTS[0]):
            continue
        stem = name.removesuffix(PARTS[0])
        if not all(stem + part in columns for part in PARTS):
            continue
        q = np.stack([found.pop(stem + part) for part in PARTS])
        length = np.sqrt(np.sum(q**2, axis=0))
        off = float(np.nanmax(np.abs(length - 1.0), initial=0.0)) if length.size else 0.0
        if off > 0.05:
            notes.append(
                f"quaternions {stem or 'of the pose'} miss the length 1 by up to {off:.3g}"
            )
        with np.errstate(invalid="ignore", divide="ignore"):
            x, y, z, w = q / length
        angles = (
            np.arctan2(2 * (w * x + y * z), 1 - 2 * (x**2 + y**2)),
            np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0)),
            np.arctan2(2 * (w * z + x * y), 1 - 2 * (y**2 + z**2)),
        )
        for turn, angle in zip(TURNS, angles, strict=True):
            good = np.isfinite(angle)
            angle[good] = np.unwrap(angle[good])
            found[stem + turn], units[stem + turn] = angle, "rad"
    return found, notes
