"""What the columns of a stream are in a model: inputs, channels, start values; and its twin."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..calibrate.columns import expand
from ..calibrate.entries import lookup
from ..calibrate.joining import Joined, snapped
from ..calibrate.mapping import read_joined
from ..calibrate.parts import MeasuredRun
from ..calibrate.problem import Problem
from ..data.signals import Table
from ..errors import InputError, ScenarioError, UnknownNameError, listing
from ..files import read_toml
from ..installation import places
from ..master.master import Master
from ..master.twin import Twin
from .messages import Sample

Vector = NDArray[np.float64]
SIMPLE = {"source", "scale", "offset", "limit"}
"""Keys of a column that a stream can follow, sample by sample."""
LONGEST = 5.0
"""Usual intervals without a sample after which a run ends, as in logs (`mapped_logs`)."""


@dataclass(frozen=True)
class Driver:
    """An input that a column drives.

    Attributes:
        target: full name of the input.
        column: of the stream.
        gain, offset: value = gain * column + offset.
        unit: of the value; "" if the input's.
        interpolation: as of a mapping.
        quantum: of a count with noise on it, 0 if it is none.
    """

    target: str
    column: str
    gain: float
    offset: float
    unit: str
    interpolation: str
    quantum: float

    def table(self, times: Vector, values: Vector) -> Table:
        """What drives the input between the first and the last of some samples.

        Args:
            times: of the samples [s].
            values: of the column, without gaps.
        """
        if self.quantum:
            values = np.rint(values / self.quantum) * self.quantum
        values = values * self.gain + self.offset if self.offset else values * self.gain
        how = self.interpolation
        if how == "slope":  # of the interval that begins
            slopes = np.diff(values) / np.diff(times)
            values, how = np.append(slopes, slopes[-1] if slopes.size else 0.0), "hold"
        elif how == "window":  # mean over the interval that ends
            values, how = np.append(values[1:], values[-1]), "hold"
        return Table(
            times, values, unit=self.unit, interpolation=how,  # type: ignore[arg-type]
            text=f"stream:{self.column}", extend=True,
        )  # fmt: skip


class Reading:
    """A data set's model, for a stream of the same columns.

    Args:
        joined, problem: of the data set.
        calibrated: values of parameters by name; the nominal ones if not given.

    Attributes:
        interval: usual one between samples [s].
        gap: longest one over which inputs are known [s].
        drivers: of the inputs.
        clock: column that is the clock.
        size: time between recorded points [s].

    Raises:
        ScenarioError: the mapping needs more than one sample at a time.
        UnknownNameError: no such parameter.
    """

    def __init__(
        self, joined: Joined, problem: Problem, calibrated: Mapping[str, float] | None = None
    ) -> None:
        self.joined, self.problem, table = joined, problem, joined.table
        self.clock = str(table.get("time", "time"))
        rate, usual = joined.data.rate, float(np.median(np.diff(problem.runs[0].times)))
        self.interval = 1.0 / rate if rate else usual  # logs may keep times rounded
        self.gap = float(table.get("gap", LONGEST * self.interval))
        every = max(round((problem.period or self.interval) / problem.step), 1)
        self._every, self.size = every, every * problem.step
        self.lead = float(table.get("lead", 0.0))
        self._made = self._columns(table)
        self.drivers = []
        for target, column, entry in joined.drivers():
            gain, offset, unit = joined.conversion(target, column, entry)
            how, quantum = str(entry.get("interpolation", "hold")), float(entry.get("quantum", 0.0))
            self.drivers.append(Driver(target, column, gain, offset, unit, how, quantum))
        if problem.relative:
            raise ScenarioError(
                f"{joined.path}: poses relative to a run's first measured one (`relative`) are not "
                "followed in a stream; give start poses by [starts] in a mapping of its own"
            )
        self.theta = problem.nominal
        for name, value in (calibrated or {}).items():
            if "@" not in name:
                self.theta[problem.index(name)] = value
        self.needs = [
            key for key, _, _ in self._entries()
            if isinstance(key, str) and not key.startswith("first:")
        ]  # fmt: skip

    def _columns(self, table: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
        """Columns that the mapping makes, by their names."""
        used = {channel for channel in self.joined.columns.values()}
        used |= {column for _, column, _ in self.joined.drivers()}
        found: dict[str, Mapping[str, Any]] = {}
        for pattern, entry in table.get("columns", {}).items():
            for i, name in enumerate(expand(pattern), 1):
                if name not in used:
                    continue
                more = sorted(set(entry) - SIMPLE)
                if more:
                    raise ScenarioError(
                        f"{self.joined.path}: column {name} has {', '.join(more)}, which a stream "
                        f"cannot follow sample by sample ({', '.join(sorted(SIMPLE))} it can); "
                        "send the column as the model needs it, with a mapping of its own"
                    )
                source = str(entry.get("source", name)).replace("{}", str(i))
                found[name] = {**entry, "source": source}
        if "resample" in table:
            raise ScenarioError(f"{self.joined.path}: a stream is not resampled; send it as it is")
        return found

    # -- columns -----------------------------------------------------------------------------------

    def column(self, samples: Sequence[Sample], name: str) -> Vector:
        """A column of the mapping over samples; what is not there is NaN."""
        entry = self._made.get(name, {})
        source = str(entry.get("source", name))
        values = np.array([sample.values.get(source, math.nan) for sample in samples])
        if "limit" in entry:
            values[np.abs(values) > float(entry["limit"])] = math.nan
        return values * float(entry.get("scale", 1.0)) + float(entry.get("offset", 0.0))

    def measured(self, samples: Sequence[Sample]) -> Vector:
        """The channels over samples, one row each."""
        rows = np.empty((len(samples), len(self.problem.channels)))
        for index, channel in enumerate(self.problem.channels):
            gain, offset = self.joined.converted[channel.name]
            values = self.column(samples, self.joined.columns[channel.name])
            rows[:, index] = values * gain + offset
        return rows

    def times(self, times: Vector) -> Vector:
        """Times on the grid of communication steps where they miss it by rounding alone."""
        return snapped(times, self.problem.step)

    def sources(self) -> list[str]:
        """Columns of the stream that drive the model, or are compared with it."""
        columns = [*(driver.column for driver in self.drivers), *self.joined.columns.values()]
        return [str(self._made.get(name, {}).get("source", name)) for name in columns]

    def check(self, sample: Sample) -> None:
        """Refuse a stream that lacks what drives the model.

        Raises:
            UnknownNameError: with the nearest names.
        """
        for driver in self.drivers:
            source = str(self._made.get(driver.column, {}).get("source", driver.column))
            if source not in sample.values:
                raise UnknownNameError(
                    f"the stream has no column {source!r}, which drives {driver.target}; "
                    f"{listing(sample.values, source)}"
                )
        known = [str(self._made.get(c, {}).get("source", c)) for c in self.joined.columns.values()]
        if not any(name in sample.values for name in known):
            raise UnknownNameError(
                f"the stream has none of the measured columns {', '.join(known)}; "
                f"{listing(sample.values, known[0])}"
            )

    # -- the twin ----------------------------------------------------------------------------------

    def _entries(self) -> list[tuple[Any, Any, str]]:
        """What the starts of a run are made of, what they set, and their units where stated."""
        table = self.joined.table
        found: list[tuple[Any, Any, str]] = []
        for key, targets in table.get("starts", {}).items():
            first = key.removeprefix("first:") if key.startswith("first:") else ""
            found.append((key, targets, self.joined.units.get(first, "")))
        for item in [*table.get("nuisance", []), *table.get("parameter", [])]:
            if item.get("per_run") or isinstance(item["nominal"], str):
                found.append((item["nominal"], item["targets"], str(item.get("unit", ""))))
        return found

    def starts(self, entries: Mapping[str, Any], first: Sample) -> dict[str, float]:
        """Full variable name -> start value of a run.

        Args:
            entries: of the run.
            first: its first sample.

        Raises:
            ScenarioError: an entry or a column that it needs is not there.
        """
        found: dict[str, float] = {}
        for key, targets, unit in self._entries():
            where = f"{self.joined.path}: the start of a run by {key}"
            value = self._start(key, entries, first, where)
            found.update({name: f * value for name, f in self.joined.targets(targets, unit, where)})
        return found

    def _start(self, key: Any, entries: Mapping[str, Any], first: Sample, where: str) -> float:
        if isinstance(key, (int, float)):
            return float(key)
        if key.startswith("first:"):
            value = float(self.column([first], key.removeprefix("first:"))[0])
            if math.isnan(value):
                raise ScenarioError(f"{where}: the first sample has no value of it")
            return value
        begun = key.startswith("begin:")
        value = lookup(entries, key.removeprefix("begin:"), where)
        return value - self.lead if begun else value

    def errors(self, starts: Mapping[str, float]) -> dict[str, float]:
        """What is wrong with columns of the stream, see `Problem.log_errors`."""
        return self.problem.log_errors(self.theta, _run(starts))

    def twin(self, starts: Mapping[str, float]) -> Twin:
        """A twin at the begin of a run, with the parameters of this reading."""
        problem = self.problem
        system = problem.model.system({**problem.values(self.theta, _run(starts))})
        master = Master(
            system, problem.algorithm, problem.step, scenario=problem.name, options=problem.options
        )
        return Twin(
            master,
            inputs={driver.target: 0.0 for driver in self.drivers},
            record=list(dict.fromkeys(channel.signal for channel in problem.channels)),
            every=self._every,
        )


def _run(starts: Mapping[str, float]) -> MeasuredRun:
    """A run of a stream, of which nothing is known but its start values."""
    return MeasuredRun("stream", "identification", np.zeros(1), np.zeros((1, 1)), {}, starts)


def read_calibrated(path: Path | str) -> dict[str, float]:
    """Values by name of a `calibration.json` (or `diagnosis.json`) that cosim wrote.

    Raises:
        InputError: it is none.
    """
    path = Path(path)
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
        return {name: float(item["value"]) for name, item in table["parameters"].items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"--calibrated {path}: is no calibration.json of 'cosim calibrate' ({error!r})"
        ) from error


def _data(content: Any) -> Iterator[str]:
    """Folders that a scenario takes columns from."""
    if isinstance(content, list):
        for item in content:
            yield from _data(item)
    elif isinstance(content, dict):
        for key, value in content.items():
            if key == "data" and isinstance(value, str):
                yield value
            else:
                yield from _data(value)


def read_reading(
    name: Path | str,
    *,
    mapping: Path | str | None = None,
    calibrated: Path | str | None = None,
    variants: Mapping[str, str] | None = None,
) -> Reading:
    """The reading of a data set, or of a scenario that has one.

    Args:
        name: folder of the data set; or a scenario of the library, for the set in its `data` that
            it is compared with.
        mapping: a `dataset.toml`, looked for if not given.
        calibrated: file of `cosim calibrate` with values of the parameters.
        variants: changes of the system, as of `cosim run --set`.

    Raises:
        InputError: a file or a name in it is wrong.
    """
    folder = Path(name)
    if not folder.is_dir():
        place = places.scenarios() / str(name)
        sets = sorted(place.glob("data/*/set.toml"))
        if len(sets) > 1:
            own = set(_data(read_toml(place / "scenario.toml")))
            sets = [file for file in sets if file.parent.relative_to(place).as_posix() in own]
        if len(sets) != 1:
            known = {p.parents[2].name for p in places.scenarios().glob("*/data/*/set.toml")}
            raise UnknownNameError(
                f"{name}: is no folder of a data set, and no scenario with one in its data; "
                + listing(sorted(known), str(name))
            )
        folder = sets[0].parent
    joined, problem = read_joined(folder, mapping=mapping)
    if variants:
        problem = problem.changed(model=problem.model.changed(variants))
    return Reading(joined, problem, read_calibrated(calibrated) if calibrated else None)
