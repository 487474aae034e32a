"""The motor bench with two short runs whose data come from the system itself."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate import Problem, read_problem
from cosim.data.signals import Table
from tests.problems import simulator

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "scenarios" / "motor_bench" / "data" / "MB-12"
LENGTH = 2001


@pytest.fixture(scope="session")
def measured() -> Problem:
    """The committed data set."""
    return read_problem(DATA)


@pytest.fixture(scope="session")
def truth(measured: Problem) -> np.ndarray:
    """Values away from the nominal ones and from the bounds."""
    return measured.lower + (measured.upper - measured.lower) * np.array(
        [0.6, 0.4, 0.55, 0.3, 0.45, 0.35, 0.6, 0.7]
    )


@pytest.fixture(scope="session")
def short(measured: Problem) -> Problem:
    """Two runs of 2 s: a sum of sines and a staircase that stays below the limits."""
    times = np.arange(LENGTH) * 1e-3
    sines = sum(20.0 * np.sin(2 * np.pi * f * times + f) for f in (0.7, 2.3, 5.1, 11.0))
    stairs = 15.0 * np.floor(times / 0.25)
    channels = len(measured.channels)
    first = measured.runs[0]
    runs = [
        replace(
            first,
            name=name,
            purpose=purpose,
            times=times,
            data=np.zeros((LENGTH, channels)),
            inputs={"motor.w_ref": Table(times, values, text=f"{name}:speed_set")},
            lead=0.0,
        )
        for name, purpose, values in (
            ("sines", "identification", sines),
            ("stairs", "identification", stairs),
            ("check", "validation", sines[::-1] + stairs - sines[-1]),
        )
    ]
    return measured.changed(runs=runs)


@pytest.fixture(scope="session")
def exact(short: Problem, truth: np.ndarray) -> dict[str, np.ndarray]:
    """What the channels read without noise."""
    return {run.name: simulator(short).simulate(truth, run) for run in short.runs}


@pytest.fixture
def noisy(short: Problem, exact: dict[str, np.ndarray]):
    """Makes the short problem with noise of a seed."""

    def make(seed: int) -> Problem:
        random = np.random.default_rng(seed)
        return short.with_data(
            {name: data + random.normal(size=data.shape) * short.sigma
             for name, data in exact.items()}
        )  # fmt: skip

    return make
