"""A disc on a shaft, driven by a known torque, as equations of its own and as a data set.

    J w' = tau - b w - law(w, theta, t)

It shares no code with the components; the mapping declares J and b, and the law is what the model
lacks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Law = Callable[[float, float, float], float]
J, B = 0.02, 0.03
INTERVAL, SPLIT = 0.01, 20
"""Of the log [s]; steps of the plant in it: its error is then far below the noise."""
SIGMA = {"w": 0.02, "theta": 0.002}
MAPPING = """
rig = "disc"
system = "system.toml"
step = 0.005
algorithm = "gauss_seidel"

[columns]
time = { unit = "s" }
tau = { unit = "N.m" }
w = { unit = "rad/s" }
theta = { unit = "rad" }

[inputs]
"load.tau" = { column = "tau", interpolation = "linear" }

[channels.w]
signal = "load.w"
sigma = 0.02

[channels.theta]
signal = "load.phi"
sigma = 0.002

[[parameter]]
name = "J"
unit = "kg.m2"
nominal = 0.025
min = 0.005
max = 0.08
targets = "load.J"

[[parameter]]
name = "b"
unit = "N.m.s/rad"
nominal = 0.02
min = 0.0
max = 0.3
targets = "load.b"
"""
SYSTEM = """
description = "A disc on a shaft."
connections = []
[instances]
load = "inertia/disc"
"""
RUNS = {
    "sweep": "identification", "steps": "identification", "slow": "identification",
    "check": "validation", "again": "validation",
}  # fmt: skip
NO_OTHERS: Mapping[str, float] = {}
SWING = 14.0
"""Of a run `swing` that a test may ask for, which has one frequency [rad/s]."""


def torque(name: str, t: Vector) -> Vector:
    """What drives the disc in a run [N.m]; the speed changes its sign in each."""
    if name == "sweep":
        return np.asarray(0.5 * np.sin(2.0 * np.pi * (0.3 + 0.15 * t) * t))
    if name == "steps":
        return np.asarray(0.4 * np.sign(np.sin(1.7 * t + 0.4)))
    if name == "slow":
        return np.asarray(0.3 * np.sin(1.1 * t) + 0.1)
    if name == "swing":
        return np.asarray(0.4 * np.sin(SWING * t))
    if name == "check":
        return np.asarray(0.35 * np.sin(2.3 * t) + 0.25 * np.sin(5.1 * t + 1.0))
    return np.asarray(0.3 * np.sign(np.sin(1.2 * t)) + 0.2 * np.sin(3.0 * t))


def run(
    name: str, law: Law, seconds: float, friction: float = B, begun: float = 0.0
) -> tuple[Vector, Vector, Vector, Vector]:
    """Time, torque, speed and angle of a run without noise, which begins with a speed."""
    time = np.arange(round(seconds / INTERVAL) + 1) * INTERVAL
    tau, h = torque(name, time), INTERVAL / SPLIT
    w, theta = np.zeros(time.size), np.zeros(time.size)

    def rate(t: float, speed: float, angle: float) -> float:
        k = min(int(t / INTERVAL), time.size - 2)
        drive = tau[k] + (tau[k + 1] - tau[k]) * (t / INTERVAL - k)
        return float((drive - friction * speed - law(speed, angle, t)) / J)

    speed, angle = begun, 0.0
    w[0] = begun
    for i in range(1, time.size):
        for j in range(SPLIT):
            t = time[i - 1] + j * h
            first = rate(t, speed, angle)
            middle = speed + 0.5 * h * first
            second = rate(t + 0.5 * h, middle, angle + 0.5 * h * speed)
            angle += h * middle
            speed += h * second
        w[i], theta[i] = speed, angle
    return time, tau, w, theta


def write(
    folder: Path, law: Law, seed: int = 3, seconds: float = 4.0, names: Iterable[str] = RUNS,
    frictions: Mapping[str, float] = NO_OTHERS, begun: float = 0.0, zero: float = 0.0,
) -> Path:  # fmt: skip
    """The data set of a disc with this law, of all runs or of those that are named.

    Args:
        folder, law, seed, seconds, names: see above.
        frictions: viscous friction in runs where it is another one.
        begun: speed that all runs begin with.
        zero: error of the logged speed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(seed)
    text = MAPPING
    for name in names:
        time, tau, w, theta = run(name, law, seconds, frictions.get(name, B), begun)
        columns = [time, tau, w + zero + SIGMA["w"] * random.standard_normal(w.size),
                   theta + SIGMA["theta"] * random.standard_normal(w.size)]  # fmt: skip
        np.savetxt(folder / f"{name}.csv", np.column_stack(columns), delimiter=",", fmt="%.7g",
                   header="time,tau,w,theta", comments="")  # fmt: skip
        purpose = RUNS.get(name, "identification")
        text += f'\n[[run]]\nname = "{name}"\nfile = "{name}.csv"\npurpose = "{purpose}"\n'
    (folder / "dataset.toml").write_text(text, encoding="utf-8")
    (folder / "system.toml").write_text(SYSTEM, encoding="utf-8")
    return folder
