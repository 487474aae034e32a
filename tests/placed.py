"""Logs of a base with two wheels that begins, and is measured, otherwise than its mapping says."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

RADIUS, TRACK, STEP = 0.0334, 0.166, 0.02
NOISE = (0.002, 0.002, 0.004)
MAPPING = """
system = "system.toml"
step = 0.01
algorithm = "gauss_seidel"
time = "t"
[inputs]
"base.w_l" = "left"
"base.w_r" = "right"
[channels]
x = { signal = "base.x", sigma = 0.002 }
y = { signal = "base.y", sigma = 0.002 }
yaw = { signal = "base.phi", sigma = 0.004 }
[[parameter]]
name = "r"
unit = "m"
nominal = 0.033
min = 0.02
max = 0.05
targets = "base.r"
[[parameter]]
name = "track"
unit = "m"
nominal = 0.16
min = 0.1
max = 0.25
targets = "base.track"
"""


class Wrong(NamedTuple):
    """What a run has that the model does not know.

    Attributes:
        pose: where it begins.
        drift: of the measured heading [rad/s].
        zero: of the measured heading [rad].
        larger: share by which the left wheel is.
        late: samples by which y comes late.
        gain: of y.
        said: heading that the run says it begins with [rad], as `heading`.
    """

    pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    drift: float = 0.0
    zero: float = 0.0
    larger: float = 0.0
    late: int = 0
    gain: float = 1.0
    said: float = 0.0


def rows(seed: int, wrong: Wrong) -> np.ndarray:
    """Time, wheel speeds and pose of a run, by exact arcs."""
    random = np.random.default_rng(seed)
    count = 400
    wheels = np.repeat(random.uniform(1.0, 9.0, (count // 50, 2)), 50, axis=0)
    pose, found = np.array(wrong.pose), []
    for left, right in wheels:
        found.append(pose)
        first, second = RADIUS * (1.0 + wrong.larger) * left, RADIUS * right
        v, w = 0.5 * (first + second), (second - first) / TRACK
        turn = 0.5 * w * STEP
        chord = v * STEP * np.sinc(turn / np.pi)
        ahead = pose[2] + turn
        pose = pose + np.array([chord * np.cos(ahead), chord * np.sin(ahead), w * STEP])
    times = np.arange(count) * STEP
    logged = np.array(found)
    logged[:, 1] = wrong.gain * logged[np.maximum(np.arange(count) - wrong.late, 0), 1]
    logged += NOISE * random.standard_normal((count, 3))
    logged[:, 2] += wrong.zero + wrong.drift * times
    return np.column_stack([times, wheels, logged])


def write(folder: Path, runs: Sequence[Wrong], more: str = "", unused: int = 0) -> Path:
    """A data set of these runs, the last ones unused."""
    (folder / "system.toml").write_text(
        'description = "Two wheels."\n[instances]\nbase = "diff_drive/rolling"\n'
    )
    table = MAPPING + more
    for k, wrong in enumerate(runs):
        np.savetxt(folder / f"r{k}.csv", rows(k, wrong), delimiter=",",
                   header="t,left,right,x,y,yaw", comments="")  # fmt: skip
        purpose = "identification" if k < len(runs) - unused else "validation"
        table += f'[[run]]\nname = "r{k}"\nfile = "r{k}.csv"\npurpose = "{purpose}"\n'
        table += f"heading = {wrong.said}\n"
    (folder / "dataset.toml").write_text(table)
    return folder
