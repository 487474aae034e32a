"""A year of logs of one motor bench, from the independent plant: the same check-up again and again.

Between logs the room is warmer or colder, which moves the winding's resistance, the magnets and the
oil; nothing else does, unless the year says so: friction that creeps up from a log on, an encoder
that is replaced by another one before a log.
"""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from benchmarks.bench import Bench
from benchmarks.motor_plant import COUNT, Drive, draw, driven, drives

Vector = NDArray[np.float64]
FIRST = datetime.date(2025, 1, 7)
SHEET = Path(__file__).parents[1] / "scenarios/motor_bench/data/motor_bench.toml"
RUNS = ("ST", "MS")
WARMER = 3.0
"""Standard deviation of the temperature between logs [K]."""
PER_KELVIN = {"R_a": 0.00393, "K_t": -0.0011, "b": -0.02}
"""Copper, ferrite magnets, oil."""
FRICTION = {"coulomb": 0.4, "b": 0.05}
"""What may creep, and by how much until the year's end [N.m; N.m.s/rad, output]."""
ENCODERS = {"zero": 0.03, "scale": 0.004, "latency": 0.002}
"""What may be other about the new encoder: its zero [rad], its scale, its latency [s]."""


@dataclass(frozen=True)
class Year:
    """What happens.

    Attributes:
        logs: how many.
        friction: of `FRICTION`, "" for none.
        creeps: first log with more friction (from 1).
        encoder: of `ENCODERS`, "" for none.
        replaced: first log with the new encoder.
        factor: on both sizes.
    """

    logs: int = 60
    friction: str = ""
    creeps: int = 30
    encoder: str = ""
    replaced: int = 45
    factor: float = 1.0


def dates(count: int, random: np.random.Generator) -> list[datetime.date]:
    """About evenly over a year, each on a day of its own."""
    apart = 365.0 / count
    days = np.arange(count) * apart + random.uniform(-0.3, 0.3, count) * apart
    return [FIRST + datetime.timedelta(days=round(day)) for day in days.tolist()]


def benches(
    year: Year, when: Sequence[datetime.date], plain: Bench, random: np.random.Generator
) -> list[Bench]:
    """The bench as it is in each log."""
    found = []
    last = min(year.creeps, year.logs) - 2
    whole = (when[-1] - when[last]).days
    for number, day in enumerate(when):
        warmer = WARMER * random.standard_normal()
        values = {
            name: value * (1.0 + PER_KELVIN.get(name, 0.0) * warmer)
            for name, value in plain.parameters.items()
        }
        one = Bench(values)
        if year.friction and number >= year.creeps - 1:
            size = year.factor * FRICTION[year.friction] * (day - when[last]).days / whole
            if year.friction in values:
                values[year.friction] += size
            else:
                one = replace(one, effect=year.friction, size=size)
        found.append(one)
    return found


def measured(
    clean: dict[str, Vector], column: int, encoder: str, factor: float, random: np.random.Generator
) -> dict[str, Vector]:
    """Channels of a run with noise and rounding, read with one of the encoders."""
    angle = clean["angle"][:, column]
    size = factor * ENCODERS.get(encoder, 0.0)
    if encoder == "zero":
        angle = angle + size
    elif encoder == "scale":
        angle = angle[0] + (1.0 + size) * (angle - angle[0])
    elif encoder == "latency":
        late = round(size / 1e-3)
        angle = np.concatenate([np.full(late, angle[0]), angle[: angle.size - late]])
    counts = np.floor(angle / COUNT)
    values = {
        "speed": np.diff(counts, prepend=counts[0]) * COUNT / 1e-3,
        "current": clean["current"][:, column],
        "voltage": clean["voltage"][:, column],
        "angle": np.rint(angle / 0.00153) * 0.00153,
    }
    noise = {"speed": 0.15, "current": 0.05, "voltage": 0.05, "angle": 0.005}
    return {
        name: column + noise[name] * random.standard_normal(column.size)
        for name, column in values.items()
    }


def machine(seed: int, seconds: float = 2.0) -> tuple[Bench, list[Drive]]:
    """The bench of a seed, and its check-up."""
    return draw(np.random.default_rng([seed, 0])), drives(seed, seconds, RUNS)


def write_years(
    folder: Path, years: Sequence[Year], seed: int, seconds: float = 2.0
) -> list[tuple[Path, list[datetime.date]]]:
    """One data set per year, all of the same bench and check-up; folders and dates.

    Args:
        folder: data sets go into folders below it.
        years: what happens in each.
        seed: of the bench, its check-up, temperatures and noise.
        seconds: duration of each run.
    """
    plain, runs = machine(seed, seconds)
    random = np.random.default_rng([seed, 1])
    when = [dates(year.logs, random) for year in years]
    states = [
        benches(year, days, plain, random) for year, days in zip(years, when, strict=True)
    ]  # fmt: skip
    clean = driven([one for state in states for one in state], runs)
    found, first = [], 0
    for number, (year, days) in enumerate(zip(years, when, strict=True)):
        place = folder / f"year_{number:03d}"
        _write(place, year, days, runs, clean, first, random)
        found.append((place, days))
        first += year.logs
    return found


def _write(
    place: Path,
    year: Year,
    days: Sequence[datetime.date],
    runs: Sequence[Drive],
    clean: Sequence[dict[str, Vector]],
    first: int,
    random: np.random.Generator,
) -> None:
    """One data set."""
    (place / "runs").mkdir(parents=True, exist_ok=True)
    text = (
        f'rig = "motor_bench"\nset = "{place.name}"\nsheet = "{SHEET.as_posix()}"\n'
        'sample_rate_hz = 1000\ncolumns = ["time", "speed_set", "speed", "current", "voltage", '
        '"angle"]\n'
    )
    for log, day in enumerate(days):
        encoder = year.encoder if log >= year.replaced - 1 else ""
        for drive, values in zip(runs, clean, strict=True):
            name = f"{log + 1:03d}-{drive.name}"
            table = {"time": np.arange(drive.w_ref.size) * 1e-3, "speed_set": drive.w_ref}
            table |= measured(values, first + log, encoder, year.factor, random)
            pd.DataFrame(table).to_parquet(place / "runs" / f"{name}.parquet")
            text += (
                f'\n[[run]]\nname = "{name}"\nfile = "runs/{name}.parquet"\ndate = {day}\n'
                f'purpose = "identification"\nduration_s = {drive.w_ref.size * 1e-3 - 1e-3}\n'
                f"initial_motor_angle = {drive.start}\ninitial_speed = 0.0\n"
            )
    (place / "set.toml").write_text(text, encoding="utf-8")
