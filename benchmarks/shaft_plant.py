"""A shaft whose torque, speed and angle are logged, with a law that its declared model lacks.

    J w' = tau - b w + law(w, phi),   phi' = w

Integrated by Runge-Kutta steps of fourth order between samples, at which the torque changes (held
inputs); no code is shared with the component `inertia/disc` that is to explain it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from cosim.calibrate.model import Model
from cosim.calibrate.parts import Channel, Coarse, MeasuredRun, Parameter
from cosim.calibrate.problem import Problem
from cosim.data.signals import Table
from cosim.installation.builder import default_provider
from cosim.system.toml import SystemFile

Law = Callable[[float, float], float]
INERTIA, FRICTION = 0.1, 0.1
SAMPLE, LENGTH, SUBSTEPS = 1e-2, 401, 4
SIGMA = {"w": 0.1, "phi": 0.05}
NAMES = {"first": "identification", "second": "identification", "third": "identification",
         "unused": "validation"}  # fmt: skip


def torque(random: np.random.Generator, level: float) -> np.ndarray:
    """A sum of slow sines over 4 s about a constant, held from sample to sample."""
    times = SAMPLE * np.arange(LENGTH)
    rates, phases = random.uniform(0.2, 1.5, 5), random.uniform(0.0, 2.0 * np.pi, 5)
    sines = np.sin(2.0 * np.pi * rates * times[:, None] + phases).sum(axis=1)
    return level * (sines + random.choice([-1.0, 1.0]))


def integrated(tau: np.ndarray, law: Law) -> np.ndarray:
    """Speed and angle at the samples."""
    step = SAMPLE / SUBSTEPS

    def rate(x: np.ndarray, value: float) -> np.ndarray:
        return np.array([(value - FRICTION * x[0] + law(x[0], x[1])) / INERTIA, x[0]])

    rows, x = [], np.zeros(2)
    for value in tau:
        rows.append(x)
        for _ in range(SUBSTEPS):
            first = rate(x, value)
            second = rate(x + 0.5 * step * first, value)
            third = rate(x + 0.5 * step * second, value)
            last = rate(x + step * third, value)
            x = x + step / 6.0 * (first + 2.0 * second + 2.0 * third + last)
    return np.array(rows)


def shaft(law: Law, seed: int, level: float = 0.5) -> Problem:
    """Three runs to fit and one that is not used, of a shaft with this law [N.m].

    Args:
        law: of speed and angle.
        seed: of commands and noise.
        level: of the commands [N.m].
    """
    random = np.random.default_rng(seed)
    times = SAMPLE * np.arange(LENGTH)
    runs = []
    for name, purpose in NAMES.items():
        tau = torque(random, level)
        noise = random.standard_normal((LENGTH, 2)) * list(SIGMA.values())
        inputs = {"load.tau": Table(times, tau, text=f"{name}:tau")}
        runs.append(MeasuredRun(name, purpose, times, integrated(tau, law) + noise, inputs))
    file = SystemFile(Path("shaft.toml"), "shaft", "", {"load": "inertia/disc"}, {}, ())
    return Problem(
        "shaft", Model.of(file, default_provider()),
        [Parameter("J", "kg.m2", 0.11, 0.08, 0.14, (("load.J", 1.0),)),
         Parameter("b", "N.m.s/rad", 0.12, 0.05, 0.2, (("load.b", 1.0),))],
        [Channel("w", "rad/s", SIGMA["w"], "load.w"),
         Channel("phi", "rad", SIGMA["phi"], "load.phi")],
        runs, SAMPLE, Coarse(SAMPLE), tick=SAMPLE,
    )  # fmt: skip
