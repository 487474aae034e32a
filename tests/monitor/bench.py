"""Many logs of the disc of `tests.diagnose.disc`, whose equations share no code with components."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.diagnose import disc

Vector = NDArray[np.float64]
LOGS, SECONDS = 18, 2.0
FIRST = datetime.date(2025, 1, 1)
APART = 7
"""Days between logs."""


@cache
def clean(viscous: float, dry: float, drive: str = "sweep") -> tuple[Vector, ...]:
    """A check-up without noise; more friction than the disc has."""
    return disc.run(
        drive, lambda w, theta, t: viscous * w + dry * float(np.tanh(w / 0.01)), SECONDS
    )


def day(log: int) -> datetime.date:
    """Date of a log, counted from 0."""
    return FIRST + datetime.timedelta(days=APART * log)


def write(
    folder: Path,
    viscous: Callable[[int], float] = lambda log: 0.0,
    dry: Callable[[int], float] = lambda log: 0.0,
    zero: Callable[[int], float] = lambda log: 0.0,
    *,
    drive: Callable[[int], str] = lambda log: "sweep",
    dated: bool = True,
    names: Callable[[int], str] = lambda log: f"log{log:02d}",
    seed: int = 5,
) -> Path:
    """A data set with one run per log.

    Args:
        folder: where.
        viscous, dry: more friction of a log.
        zero: error of the angle in a log.
        drive: torque of a log, by its name in `disc`.
        dated: whether runs have a date.
        names: of files.
        seed: of noise and of what differs from log to log.
    """
    folder.mkdir(parents=True)
    random = np.random.default_rng(seed)
    # exchanged so often that the step's error is below the noise
    text = disc.MAPPING.replace("step = 0.005", "step = 0.0005")
    for log in range(LOGS):
        # oil is warmer or colder; rounded, so that logs of equal warmth share a simulation
        warm = round(float(np.clip(random.standard_normal(), -2.0, 2.0)), 0) * 1e-4
        time, tau, w, theta = clean(viscous(log) + warm, dry(log), drive(log))
        w = w + disc.SIGMA["w"] * random.standard_normal(w.size)
        theta = theta + zero(log) + disc.SIGMA["theta"] * random.standard_normal(w.size)
        columns = [time, tau, w, theta]
        file = f"{names(log)}.csv"
        np.savetxt(folder / file, np.column_stack(columns), delimiter=",", fmt="%.7g",
                   header="time,tau,w,theta", comments="")  # fmt: skip
        text += f'\n[[run]]\nname = "R{log:02d}"\nfile = "{file}"\npurpose = "identification"\n'
        if dated:
            text += f"date = {day(log)}\n"
    (folder / "dataset.toml").write_text(text, encoding="utf-8")
    (folder / "system.toml").write_text(disc.SYSTEM, encoding="utf-8")
    return folder
