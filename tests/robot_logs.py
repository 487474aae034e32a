"""Logs of a robot on two wheels, made by exact arcs: no code of ours is in them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
RADIUS, TRACK = 0.05, 0.2
"""[m] Of the robot that drives."""
PERIOD, FRAME = 0.02, 0.04
"""[s] Of the commands, and of the camera."""
EPOCH = 1_764_040_000 * 10**9
"""[ns] When the first command is given."""
NOISE = (0.002, 0.002, 0.004)
"""[m, m, rad] Of the camera."""


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


def drive(seed: int, *, late: float = 0.0, duration: float = 12.0) -> Drive:
    """A run over random commands that stand for half a second each.

    Args:
        seed: of commands and noise.
        late: how much the camera's clock is late [s].
        duration: [s].
    """
    chance = np.random.default_rng(seed)
    count = round(duration / PERIOD)
    times = PERIOD * np.arange(count)
    held = 25
    speeds = np.repeat(chance.uniform(1.0, 8.0, (count // held + 1, 2)), held, axis=0)[:count]
    left, right = speeds.T
    v, w = RADIUS * (left + right) / 2, RADIUS * (right - left) / TRACK
    yaw = 3.0 + np.append(0.0, np.cumsum(w * PERIOD))
    # exact along arcs: the chord has the middle direction
    chord = v * PERIOD * np.sinc(w * PERIOD / 2 / np.pi)
    x = 1.5 + np.append(0.0, np.cumsum(chord * np.cos(yaw[:-1] + w * PERIOD / 2)))
    y = -0.7 + np.append(0.0, np.cumsum(chord * np.sin(yaw[:-1] + w * PERIOD / 2)))
    every = round(FRAME / PERIOD)
    pose = np.column_stack([x, y, yaw])[:-1:every]
    pose = pose + chance.normal(0.0, NOISE, pose.shape)
    return Drive(times, left, right, times[::every] + late, pose)


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


def stamp(time: float) -> int:
    """A time as nanoseconds since 1970."""
    return EPOCH + round(time * 1e9)


SYSTEM = f"""
description = "A robot on two wheels."
[instances]
base = "diff_drive/rolling"
[parameters]
"base.r" = {1.1 * RADIUS}
"base.track" = {0.9 * TRACK}
"""
"""Its radius and track are a tenth off."""
