"""One individual of a rig with laws that its sheet does not declare."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Vector = NDArray[np.float64]
INSIDE = 0.15
"""Share of a parameter's range, on both sides, from which no truth is drawn."""


@dataclass(frozen=True)
class Law:
    """An undeclared law: its name in the plant, its size, and its shape where it has one."""

    name: str
    size: float
    shape: float = 0.0


@dataclass(frozen=True)
class Bench:
    """One individual: its parameters, and its undeclared laws, of which the first stands apart."""

    parameters: dict[str, float]
    effect: str = "none"
    size: float = 0.0
    shape: float = 0.0
    others: tuple[Law, ...] = ()

    @property
    def laws(self) -> tuple[Law, ...]:
        """All of them; a clean individual has none."""
        first = () if self.effect == "none" else (Law(self.effect, self.size, self.shape),)
        return (*first, *self.others)

    def of(self, name: str) -> float:
        """Size of one of its laws, 0 of one that it does not have."""
        return sum(law.size for law in self.laws if law.name == name)

    def form(self, name: str, usual: dict[str, float]) -> float:
        """Shape of one of its laws, the usual one where none was drawn."""
        drawn = [law.shape for law in self.laws if law.name == name and law.shape]
        return drawn[0] if drawn else usual.get(name, 0.0)

    def alone(self) -> list[Bench]:
        """The individual with each of its laws alone, itself if it has none."""
        laws = self.laws or (Law("none", 0.0),)
        return [Bench(self.parameters, law.name, law.size, law.shape) for law in laws]


@dataclass(frozen=True)
class Logged:
    """One run of a data set: columns, the time first, and what its entry says besides."""

    name: str
    purpose: str
    columns: dict[str, Vector]
    entries: dict[str, Any] = field(default_factory=dict)


def write_set(place: Path, rig: str, sheet: Path, rate: int, runs: Sequence[Logged]) -> Path:
    """Write a data set, its samples at a rate in Hz; returns its folder."""
    (place / "runs").mkdir(parents=True, exist_ok=True)
    columns = ", ".join(f'"{name}"' for name in runs[0].columns)
    text = (f'rig = "{rig}"\nset = "{place.name}"\nsheet = "{sheet.as_posix()}"\n'
            f"sample_rate_hz = {rate}\ncolumns = [{columns}]\n")  # fmt: skip
    for run in runs:
        pd.DataFrame(run.columns).to_parquet(place / "runs" / f"{run.name}.parquet")
        last = next(iter(run.columns.values())).size - 1
        text += (f'\n[[run]]\nname = "{run.name}"\nfile = "runs/{run.name}.parquet"\n'
                 f'purpose = "{run.purpose}"\nduration_s = {last / rate}\n')  # fmt: skip
        text += "".join(f"{name} = {value}\n" for name, value in run.entries.items())
    (place / "set.toml").write_text(text, encoding="utf-8")
    return place


def parameters(
    random: np.random.Generator, declared: Mapping[str, tuple[float, float]]
) -> dict[str, float]:
    """Values of an individual within the bounds of its sheet."""
    values = {}
    for name, (low, high) in declared.items():
        margin = INSIDE * (high - low)
        values[name] = float(random.uniform(low + margin, high - margin))
    return values


def drawn_form(random: np.random.Generator, bounds: tuple[float, float], *, wide: bool) -> float:
    """Shape of a law: a direction anyway, log-uniform if `wide`; 0, the usual one, else."""
    low, high = bounds
    if low < 0.0:
        return float(random.uniform(low, high))
    if high and wide:
        return float(np.exp(random.uniform(np.log(low), np.log(high))))
    return 0.0


def camera(poses: Vector, skew: Vector, late: Vector, sample: float) -> Vector:
    """Poses at the times that a camera's clock shows, in between linearly.

    Args:
        poses: (times, 3, individuals).
        skew, late: of the clock of each individual, [1] and [s].
        sample: interval of the poses [s].
    """
    if not np.any(skew) and not np.any(late):
        return poses
    times = np.arange(poses.shape[0]) * sample
    seen = np.empty_like(poses)
    for column in range(poses.shape[2]):
        when = times * (1.0 + skew[column]) - late[column]
        for k in range(3):
            seen[:, k, column] = np.interp(when, times, poses[:, k, column])
    return seen


def beside(
    values: Mapping[str, Vector], runs: Sequence[tuple[str, int]], count: int
) -> list[dict[str, dict[str, Vector]]]:
    """How individuals differ from their twins: for each, run -> channel -> values.

    Args:
        values: channel -> (times, columns): of each run all individuals, then all their twins.
        runs: names, and how many samples count.
        count: number of individuals.
    """
    return [
        {
            name: {
                channel: table[:rows, 2 * k * count + column]
                - table[:rows, (2 * k + 1) * count + column]
                for channel, table in values.items()
            }
            for k, (name, rows) in enumerate(runs)
        }
        for column in range(count)
    ]
