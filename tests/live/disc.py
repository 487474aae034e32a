"""A small rig for tests of streams: a disc on a shaft whose torque is commanded, at 100 Hz."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.machine import Machine
from cosim.live.reading import Reading, read_reading

INTERVAL, SIGMA_W, SIGMA_PHI = 0.01, 0.02, 0.005
SYSTEM = """
connections = []
[instances]
load = "inertia.lab_bench/disc"
"""
MAPPING = f"""
system = "system.toml"
step = {INTERVAL}
algorithm = "gauss_seidel"
[starts]
angle_0 = "load.angle"
[inputs]
"load.tau" = "torque"
[channels.w]
signal = "load.w"
sigma = {SIGMA_W}
unit = "rad/s"
[channels.phi]
signal = "load.phi"
sigma = {SIGMA_PHI}
unit = "rad"
[[parameter]]
name = "b"
unit = "N.m.s/rad"
nominal = 0.06
min = 0.01
max = 0.2
targets = "load.b"
[[run]]
name = "A"
file = "a.csv"
purpose = "identification"
angle_0 = 0.25
"""


def commands(count: int, seed: int = 1) -> dict[str, np.ndarray]:
    """Torques that change every second."""
    steps = np.random.default_rng(seed).uniform(-0.4, 0.4, count // 100 + 1)
    return {"torque": np.repeat(steps, 100)[:count]}


def rig(folder: Path) -> Reading:
    """The data set, with a log of two seconds, as a reading."""
    folder.mkdir(exist_ok=True)
    (folder / "system.toml").write_text(SYSTEM)
    (folder / "dataset.toml").write_text(MAPPING)
    empty = {"time": INTERVAL * np.arange(200), "torque": 0.0, "w": 0.0, "phi": 0.25}
    pd.DataFrame(empty).to_csv(folder / "a.csv", index=False)
    reading = read_reading(folder)
    rows = next(Machine(reading, commands(200), {"angle_0": 0.25}, seed=7).rows())
    pd.DataFrame(rows).to_csv(folder / "a.csv", index=False)
    return read_reading(folder)
