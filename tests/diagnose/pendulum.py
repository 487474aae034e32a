"""A pendulum that a known torque swings, as equations of its own and as a data set.

    J w' = tau - b w - m g l sin(phi)

In its unused run it goes over the top, which magnifies what its parameters are off by some
thousand times.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
J, B, M, L, G = 0.05, 0.05, 1.0, 0.2, 9.81
INTERVAL, SPLIT, SECONDS = 0.005, 10, 6.0
SIGMA = {"phi": 1e-3, "w": 0.02}
RUNS = {"sines": ("identification", 0.9), "steps": ("identification", 0.8),
        "over": ("validation", 1.3)}  # fmt: skip
"""Purpose, and largest torque [N.m]: m g l is 1.96 N.m."""
MAPPING = f"""
rig = "pendulum"
system = "system.toml"
step = 1e-3
algorithm = "gauss_seidel"
period = {INTERVAL}

[columns]
time = {{ unit = "s" }}
tau = {{ unit = "N.m" }}
phi = {{ unit = "rad" }}
w = {{ unit = "rad/s" }}

[parameters]
"arm.l" = {L}

[inputs]
"arm.tau" = {{ column = "tau" }}

[channels]
phi = {{ signal = "arm.phi", sigma = {SIGMA["phi"]} }}
w = {{ signal = "arm.w", sigma = {SIGMA["w"]} }}
"""
SYSTEM = """
description = "A pendulum."
connections = []
[instances]
arm = "inertia/pendulum"
"""
OPEN = {"J": (J, "kg.m2"), "b": (B, "N.m.s/rad"), "m": (M, "kg")}


def swung(tau: Vector) -> tuple[Vector, Vector]:
    """Angle and speed where a torque is held over each interval."""
    phi, w, h = np.zeros(tau.size), np.zeros(tau.size), INTERVAL / SPLIT

    def rate(angle: float, speed: float, torque: float) -> float:
        return (torque - B * speed - M * G * L * math.sin(angle)) / J

    a = v = 0.0
    for i in range(1, tau.size):
        torque = float(tau[i - 1])
        for _ in range(SPLIT):
            k1 = rate(a, v, torque)
            k2 = rate(a + h / 2 * v, v + h / 2 * k1, torque)
            k3 = rate(a + h / 2 * (v + h / 2 * k1), v + h / 2 * k2, torque)
            k4 = rate(a + h * (v + h / 2 * k2), v + h * k3, torque)
            a, v = a + h * (v + h / 6 * (k1 + k2 + k3)), v + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        phi[i], w[i] = a, v
    return phi, w


def write(folder: Path, seed: int = 1) -> Path:
    """The data set of a pendulum."""
    folder.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(seed)
    time = np.arange(round(SECONDS / INTERVAL) + 1) * INTERVAL
    text = MAPPING
    for name, (value, unit) in OPEN.items():
        text += f'\n[[parameter]]\nname = "{name}"\nunit = "{unit}"\nnominal = {value}\n'
        text += f'min = {0.1 * value}\nmax = {5.0 * value}\ntargets = "arm.{name}"\n'
    for name, (purpose, size) in RUNS.items():
        wave = np.sin(1.9 * time + 0.3)
        tau = size * (np.sin(2.0 * time + 0.7 * time**2) if name == "sines" else np.sign(wave))
        phi, w = swung(tau)
        phi += SIGMA["phi"] * random.standard_normal(phi.size)
        w += SIGMA["w"] * random.standard_normal(w.size)
        np.savetxt(folder / f"{name}.csv", np.column_stack([time, tau, phi, w]), delimiter=",",
                   fmt="%.9g", header="time,tau,phi,w", comments="")  # fmt: skip
        text += f'\n[[run]]\nname = "{name}"\nfile = "{name}.csv"\npurpose = "{purpose}"\n'
    (folder / "dataset.toml").write_text(text, encoding="utf-8")
    (folder / "system.toml").write_text(SYSTEM, encoding="utf-8")
    return folder
