"""Logs of a robot on two wheels, made by exact arcs: no FMU is in them.

Four runs as a robot gives them, each as two tables (commands on one clock, poses of a camera on
another, late one; rpm, mm, and degrees that begin anew at 180), as ROS 2 bags, if the library
`rosbags` is installed, and `robot.toml`, a system that knows the robot's sizes roughly and nothing
of its left wheel, which is larger than its right one.
"""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..files import make_folder, write_text

Vector = NDArray[np.float64]
RADIUS, TRACK = 0.05, 0.2
"""[m] Of the robot that drives."""
PERIOD, FRAME = 0.02, 0.04
"""[s] Of the commands, and of the camera."""
EPOCH = 1_764_040_000 * 10**9
"""[ns] When the first command is given."""
NOISE = (0.002, 0.002, 0.004)
"""[m, m, rad] Of the camera."""
LARGER, LATE = 0.04, 0.25
"""Of the example: by how much the left wheel is larger, and how late the camera's clock is [s]."""
RUNS = ("run_1", "run_2", "run_3", "run_4")


@dataclass(frozen=True)
class Drive:
    """A run: commands on one clock, poses on another.

    Attributes:
        commanded: times of the commands [s] since `EPOCH`.
        left, right: commanded speeds of the wheels [rad/s].
        stamped: times that the camera says [s].
        pose: x, y [m] and yaw [rad], counted on.
    """

    commanded: Vector
    left: Vector
    right: Vector
    stamped: Vector
    pose: Vector


def drive(seed: int, *, late: float = 0.0, larger: float = 0.0, duration: float = 12.0) -> Drive:
    """A run over random commands that stand for half a second each.

    Args:
        seed: of commands and noise.
        late: how much the camera's clock is late [s].
        larger: share by which the left wheel is larger than the right one.
        duration: [s].
    """
    chance = np.random.default_rng(seed)
    count = round(duration / PERIOD)
    times = np.linspace(0.0, PERIOD * count, count, endpoint=False)
    held = 25
    speeds = np.repeat(chance.uniform(1.0, 8.0, (count // held + 1, 2)), held, axis=0)[:count]
    left, right = speeds.T
    v_left, v_right = RADIUS * (1.0 + larger) * left, RADIUS * right
    v, w = (v_left + v_right) / 2, (v_right - v_left) / TRACK
    yaw = 3.0 + np.append(0.0, np.cumsum(w * PERIOD))
    # exact along arcs: the chord has the middle direction
    chord = v * PERIOD * np.sinc(w * PERIOD / 2 / np.pi)
    x = 1.5 + np.append(0.0, np.cumsum(chord * np.cos(yaw[:-1] + w * PERIOD / 2)))
    y = -0.7 + np.append(0.0, np.cumsum(chord * np.sin(yaw[:-1] + w * PERIOD / 2)))
    every = round(FRAME / PERIOD)
    pose = np.column_stack([x, y, yaw])[:-1:every]
    pose = pose + chance.normal(0.0, NOISE, pose.shape)
    return Drive(times, left, right, times[::every] + late, pose)


def stamp(time: float) -> int:
    """A time as nanoseconds since 1970."""
    return EPOCH + round(time * 1e9)


def write_csv(run: Drive, name: str, folder: Path) -> list[Path]:
    """The run as two files: rpm, and mm with degrees that begin anew at 180."""
    commands, poses = folder / f"{name}_cmd.csv", folder / f"{name}_pose.csv"
    lines = ["stamp_ns,left_rpm,right_rpm"]
    for time, left, right in zip(run.commanded, run.left, run.right, strict=True):
        lines.append(f"{stamp(time)},{left * 30 / np.pi:.12g},{right * 30 / np.pi:.12g}")
    commands.write_text("\n".join(lines) + "\n")
    lines = ["stamp_ns,px_mm,py_mm,heading_deg"]
    for time, (x, y, yaw) in zip(run.stamped, run.pose, strict=True):
        degrees = (np.degrees(yaw) + 180.0) % 360.0 - 180.0
        lines.append(f"{stamp(time)},{1e3 * x:.1f},{1e3 * y:.1f},{degrees:.2f}")
    poses.write_text("\n".join(lines) + "\n")
    return [commands, poses]


def write_bag(run: Drive, path: Path, plugin: str = "MCAP") -> Path:
    """The run as a ROS 2 bag: wheel speeds as JointState, poses as PoseStamped, recorded later."""
    from rosbags import rosbag2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types

    def header(time: int, frame: str) -> Any:
        moment = types["builtin_interfaces/msg/Time"](time // 10**9, time % 10**9)
        return types["std_msgs/msg/Header"](moment, frame)

    sent = []
    for time, left, right in zip(run.commanded, run.left, run.right, strict=True):
        joints = types["sensor_msgs/msg/JointState"](
            header(stamp(time), ""), ["left", "right"], np.zeros(0), np.array([left, right]),
            np.zeros(0),
        )  # fmt: skip
        sent.append((stamp(time) + 1_000_000, "/wheel_cmd", joints))
    for time, (x, y, yaw) in zip(run.stamped, run.pose, strict=True):
        turned = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2))
        pose = types["geometry_msgs/msg/Pose"](types["geometry_msgs/msg/Point"](x, y, 0.0), turned)
        message = types["geometry_msgs/msg/PoseStamped"](header(stamp(time), "map"), pose)
        sent.append((stamp(time) + 5_000_000, "/camera/pose", message))
    storage = rosbag2.StoragePlugin[plugin]
    with rosbag2.Writer(path, version=9, storage_plugin=storage) as writer:
        known = {}
        for time, topic, message in sorted(sent, key=lambda item: item[0]):
            kind = message.__msgtype__
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(known[topic], time, store.serialize_cdr(message, kind))
    return path


SYSTEM = f"""description = "A robot on two wheels."

[instances]
base = "diff_drive/rolling"

[parameters]
"base.r" = {1.1 * RADIUS:.3f}
"base.track" = {0.9 * TRACK:.3f}
"""
"""Its radius and track are a tenth off."""


def write(folder: Path) -> bool:
    """Write the example.

    Returns:
        Whether bags are among it.
    """
    make_folder(folder)
    write_text(folder / "robot.toml", SYSTEM)
    bags = importlib.util.find_spec("rosbags") is not None
    for seed, name in enumerate(RUNS):
        run = drive(seed, late=LATE, larger=LARGER, duration=20.0)
        write_csv(run, name, folder)
        if bags and not (folder / f"{name}_bag").exists():
            write_bag(run, folder / f"{name}_bag")
    return bags
