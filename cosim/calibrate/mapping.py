"""Reads a data set and the mapping of its rig to a system: the parts of a calibration problem.

`dataset.toml` (docs/datasets.md has the schema) says which system describes the rig, which
variables the sheet's parameters set, which columns drive inputs, and what each measured column is
in the model. It is looked for in the data set's folder, above it, and among the scenarios by its
`rig`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data.logs import DataSet, Log, LoggedRun, read_data_set
from ..data.segments import pieces, relative_pose, windows
from ..data.signals import Table
from ..errors import ScenarioError, UnknownNameError, listing
from ..files import flatten, read_toml
from ..installation import builder, places
from ..system.provider import Provider
from ..system.toml import SystemFile, read_system
from .columns import ITEM, expand, prepared
from .model import Model
from .parts import COINCIDENT, Channel, Coarse, MeasuredRun, Parameter, check_parameters
from .problem import Problem

Vector = NDArray[np.float64]
KEYS = {
    "description", "rig", "system", "step", "algorithm", "period", "parameters", "sheet", "fixed",
    "inputs", "starts", "channels", "parameter", "nuisance", "lead",
    "only", "run", "columns", "time", "ticks", "search_step", "search",
    "resample", "relative", "base", "further",
}  # fmt: skip
_CHANNEL = {"signal", "column", "gain", "offset", "sigma", "quantum", "roundings", "transform",
            "window", "unit", "shift"}  # fmt: skip
_INPUT = {"column", "columns", "gain", "unit", "interpolation", "quantum"}


def find_mapping(folder: Path, rig: str) -> Path:
    """The `dataset.toml` for a data set.

    Raises:
        ScenarioError: there is none.
    """
    for place in (folder, folder.parent, folder.parent.parent):
        if (place / "dataset.toml").is_file():
            return place / "dataset.toml"
    known = []
    for path in sorted(places.scenarios().rglob("dataset.toml")):
        name = str(read_toml(path).get("rig", path.parent.name))
        if name == rig:
            return path
        known.append(name)
    raise ScenarioError(
        f"{folder}: no dataset.toml says how rig {rig!r} maps to a system; {listing(known, rig)}; "
        "write one beside the data"
    )


def find_system(path: Path, name: str) -> SystemFile:
    """The system that a mapping names.

    Raises:
        UnknownNameError: there is none.
    """
    files = [path.parent / name] if name.endswith(".toml") else []
    for folder in (path.parent, *path.parents, places.scenarios()):
        files.append(folder / "systems" / f"{name}.toml")
    for file in files:
        if file.is_file():
            return read_system(file)
    known = [item.stem for item in sorted((places.scenarios() / "systems").glob("*.toml"))]
    raise UnknownNameError(f"{path}: there is no system {name!r}; {listing(known, name)}")


def _targets(entry: Any, where: str) -> tuple[tuple[str, float], ...]:
    """`"a.b"`, a list of such, or a table variable -> factor."""
    if isinstance(entry, str):
        return ((entry, 1.0),)
    if isinstance(entry, list):
        return tuple((str(item), 1.0) for item in entry)
    if isinstance(entry, dict):
        return tuple((name, float(factor)) for name, factor in flatten(entry).items())
    raise ScenarioError(f"{where}: {entry!r} names no variables")


def _lookup(values: Mapping[str, Any], key: str, where: str) -> float:
    match = ITEM.fullmatch(key)
    if match is None or match["key"] not in values:
        raise ScenarioError(f"{where}: there is no entry {key!r}; {listing(values, key)}")
    value = values[match["key"]]
    return float(value[int(match["index"])] if match["index"] else value)


def read_problem(
    folder: Path | str,
    provider: Provider | None = None,
    *,
    mapping: Path | str | None = None,
    system: str | None = None,
    only: Mapping[str, Any] | None = None,
) -> Problem:
    """Read a data set as a calibration problem.

    Args:
        folder: with `set.toml`.
        provider: where variants come from; builds them if not given.
        mapping: a `dataset.toml`, looked for if not given.
        system: another system than the mapping's, with the same instances.
        only: entries that the runs must have, besides those of the mapping's `only`.

    Raises:
        ScenarioError, UnknownNameError: a file or a name in it is wrong.
    """
    if provider is None:
        provider = builder.default_provider()
    folder = Path(folder)
    if (folder / "set.toml").is_file():
        data = read_data_set(folder)
        path = Path(mapping) if mapping is not None else find_mapping(folder, data.rig)
    else:
        path = Path(mapping) if mapping is not None else find_mapping(folder, "")
        data = _plain(folder, path)
    further = [
        partial(read_problem, folder, provider, mapping=path.parent / name, only=only)
        for name in read_mapping(path).get("further", [])
    ]
    return _Mapping(path, data, only or {}).problem(provider, system).changed(further=further)


def read_mapping(path: Path) -> dict[str, Any]:
    """A mapping file; what it does not say is as in the file that it names as its `base`."""
    table = read_toml(path)
    if "base" not in table:
        return table
    return {**read_mapping(path.parent / str(table["base"])), "further": [], **table}


def _plain(folder: Path, path: Path) -> DataSet:
    """A data set of plain logs, whose runs the mapping lists."""
    runs = read_mapping(path).get("run", [])
    if not runs:
        raise ScenarioError(
            f"{folder}: has no set.toml, and {path} lists no runs "
            "([[run]] with name, file, purpose)"
        )
    try:
        found = {
            entry["name"]: LoggedRun(
                entry["name"], folder / entry["file"], entry["purpose"], dict(entry)
            )
            for entry in runs
        }
    except KeyError as error:
        raise ScenarioError(f"{path}: a run lacks {error}") from None
    return DataSet(folder, folder.resolve().name, "", found, {}, {}, {})


def snapped(times: Vector, step: float) -> Vector:
    """Times on the grid of communication steps where they miss it by no more than rounding.

    A set value whose time is a rounding error late would otherwise act one step late.
    """
    if times.size < 2:
        return times
    nearest = np.rint(times / step) * step
    near = np.abs(times - nearest) <= COINCIDENT * float(np.median(np.diff(times)))
    return np.asarray(np.where(near, nearest, times), dtype=np.float64)


class _Mapping:
    """Joins a mapping file and a data set."""

    def __init__(self, path: Path, data: DataSet, only: Mapping[str, Any]) -> None:
        self.path, self.data = path, data
        self.table = read_mapping(path)
        unknown = set(self.table) - KEYS
        if unknown:
            first = sorted(unknown)[0]
            raise ScenarioError(f"{path}: has no key {first!r}; {listing(sorted(KEYS), first)}")
        self.noise = {
            column: sigma for name, sigma in data.noise.items() for column in expand(name)
        }
        self.units = {column: unit for name, unit in data.units.items() for column in expand(name)}
        wanted = {**self.table.get("only", {}), **only}
        self.logs: dict[str, Log] = {}
        self.purposes: dict[str, str] = {}
        lead = float(self.table.get("lead", 0.0))
        for run in data.runs.values():
            if any(run.values.get(key, value) != value for key, value in wanted.items()):
                continue
            for name, part in pieces(data.log(run.name)):
                log = prepared(part, self.table, self.path)
                self.units.update({column: unit for column, unit in log.units.items() if unit})
                for one, window in windows(name, log, lead):
                    self.logs[one], self.purposes[one] = window, run.purpose

    def problem(self, provider: Provider, system: str | None) -> Problem:
        """The problem."""
        table = self.table
        file = find_system(self.path, system or str(table.get("system", "")))
        constants = {name: float(value) for name, value in
                     flatten(table.get("parameters", {})).items()}  # fmt: skip
        fixed = self.data.sheet.get("fixed", {})
        for key, entry in table.get("fixed", {}).items():
            value = _lookup(fixed, key, f"{self.path}: [fixed]")
            constants.update({name: factor * value for name, factor in
                              _targets(entry, f"{self.path}: {key}")})  # fmt: skip
        self.columns: dict[str, str] = {}
        channels = [
            self.channel(one, {**entry, "signal": entry.get("signal", "").replace("{}", str(i))})
            for name, entry in table["channels"].items()
            for i, one in enumerate(expand(name), 1)
        ]
        present = [c for c in channels if any(self._column(c) in log.columns
                                              for log in self.logs.values())]  # fmt: skip
        stated = [*self.declared(), *self.others()]
        check_parameters(stated)
        parameters = [p for p in stated if not p.late]
        return Problem(
            self.data.name,
            Model.of(file, provider),
            parameters,
            present,
            [self.run(name, present) for name in self.logs],
            float(table["step"]),
            self.search(),
            constants=constants,
            algorithm=str(table.get("algorithm", "jacobi")),
            period=float(table["period"]) if "period" in table else None,
            ticks=bool(table.get("ticks", False)),
            relative=[tuple(names) for names in self.table.get("relative", [])],
            late=[p for p in stated if p.late],
        )

    def search(self) -> Coarse:
        """How the system is run in a search."""
        step, table = self.table.get("search_step"), self.table.get("search", {})
        if set(table) - {"options", "parameters"}:
            raise ScenarioError(f"{self.path}: [search] has options and parameters, no other keys")
        if table and (step is None or step == self.table["step"] or not self.table.get("ticks")):
            raise ScenarioError(
                f"{self.path}: [search] needs a search_step other than step = "
                f"{self.table['step']} and ticks = true: its error is measured against these ticks"
            )
        parameters = {name: float(v) for name, v in flatten(table.get("parameters", {})).items()}
        if step is None:
            return Coarse(float(self.table["step"]))
        return Coarse(float(step), table.get("options", {}), parameters)

    def _column(self, channel: Channel) -> str:
        return self.columns[channel.name]

    def channel(self, name: str, entry: Mapping[str, Any]) -> Channel:
        """One measured column."""
        where = f"{self.path}: channel {name}"
        unknown = set(entry) - _CHANNEL
        if unknown or not entry["signal"]:
            raise ScenarioError(f"{where}: wrong keys {sorted(unknown)}, or no signal")
        column = str(entry.get("column", name))
        self.columns[name] = column
        sigma = float(entry.get("sigma", self.noise.get(column, 0.0)))
        rounding = float(entry.get("quantum", 0.0)) ** 2 / 12.0 * int(entry.get("roundings", 1))
        sigma = math.sqrt(sigma**2 + rounding)
        if not sigma > 0.0:
            raise ScenarioError(f"{where}: its noise is not known; give sigma")
        return Channel(
            name,
            str(entry.get("unit", self.units.get(column, ""))),
            sigma,
            str(entry["signal"]),
            float(entry.get("gain", 1.0)),
            float(entry.get("offset", 0.0)),
            str(entry.get("transform", "sample")),
            float(entry.get("window", 0.0)),
            float(entry.get("shift", 0.0)),
        )

    def declared(self) -> list[Parameter]:
        """The sheet's parameters."""
        sheet = self.data.sheet.get("parameter", {})
        mapped = self.table.get("sheet", {})
        found = []
        for name, entry in sheet.items():
            if name not in mapped:
                raise ScenarioError(
                    f"{self.path}: [sheet] says nothing about the sheet's parameter {name!r}"
                )
            targets = _targets(mapped[name], f"{self.path}: [sheet] {name}")
            found.append(
                Parameter(
                    name, entry.get("unit", ""), float(entry["nominal"]), float(entry["min"]),
                    float(entry["max"]), targets, text=entry.get("description", ""),
                )
            )  # fmt: skip
        return found

    def others(self) -> list[Parameter]:
        """Parameters beyond the sheet's, and nuisance values, per run if they are."""
        found = []
        for role, key in (("declared", "parameter"), ("nuisance", "nuisance")):
            for entry in self.table.get(key, []):
                where = f"{self.path}: {key} {entry.get('name')}"
                targets = _targets(entry["targets"], where)
                runs = list(self.logs) if entry.get("per_run") else [""]
                for run in runs:
                    nominal = self.value(entry["nominal"], run, where)
                    span = float(entry.get("span", 0.0))
                    low = float(entry["min"]) if "min" in entry else nominal - span
                    high = float(entry["max"]) if "max" in entry else nominal + span
                    prior = float(entry["prior"]) if "prior" in entry else None
                    name = f"{entry['name']}@{run}" if run else str(entry["name"])
                    found.append(
                        Parameter(
                            name, entry.get("unit", ""), nominal, low, high, targets,
                            role, run, prior, text=entry.get("description", ""),  # type: ignore[arg-type]
                            late=bool(entry.get("late", False)),
                        )
                    )  # fmt: skip
        return found

    def value(self, entry: Any, run: str, where: str) -> float:
        """A number, an entry of the run (`initial_pose[0]`), or a column's start (`first:x`).

        `begin:x` is an entry that tells when the log begins, for the simulation, which begins
        before it by `lead`.
        """
        if isinstance(entry, (int, float)):
            return float(entry)
        if entry.startswith("begin:"):
            known = _lookup(self.logs[run].values, entry.removeprefix("begin:"), where)
            return known - float(self.table.get("lead", 0.0))
        if entry.startswith("first:"):
            log = self.logs[run]
            values = log[entry.removeprefix("first:")][log.time >= 0.0]
            return float(values[np.isfinite(values)][0])
        return _lookup(self.logs[run].values, entry, where)

    def run(self, name: str, channels: list[Channel]) -> MeasuredRun:
        """One run."""
        log = self.logs[name]
        starts: dict[str, float] = {}
        for key, entry in self.table.get("starts", {}).items():
            where = f"{self.path}: [starts] {key}"
            value = self.value(key, name, where)
            starts.update({n: factor * value for n, factor in _targets(entry, where)})
        lead = float(self.table.get("lead", 0.0))
        during = log.time >= 0.0
        data = np.column_stack([self._measured(log, c)[during] for c in channels])
        anchor = 0
        for triple in self.table.get("relative", []):
            place = [[c.name for c in channels].index(one) for one in triple]
            known = np.flatnonzero(np.isfinite(data[:, place]).all(axis=1))
            if not known.size:
                raise ScenarioError(f"{log.name}: {', '.join(triple)} are never measured together")
            anchor = int(known[0])
            data[:, place] = relative_pose(data[:, place], anchor)
        return MeasuredRun(
            name,
            self.purposes[name],
            log.time[during] + lead,
            data,
            {
                one: signal
                for target, entry in self.table.get("inputs", {}).items()
                for one, signal in self._inputs(log, target, entry, lead).items()
            },
            starts,
            log.values,
            lead,
            anchor,
        )

    def _measured(self, log: Log, channel: Channel) -> Vector:
        column = self._column(channel)
        if column not in log.columns:
            return np.full(log.time.shape, np.nan)
        return log[column]

    def _inputs(self, log: Log, target: str, entry: Any, lead: float) -> dict[str, Table]:
        """The signals of an input, or of all elements of a vector input."""
        if isinstance(entry, str):
            entry = {"column": entry}
        where = f"{self.path}: input {target}"
        unknown = set(entry) - _INPUT
        if unknown or not {"column", "columns"} & set(entry):
            raise ScenarioError(f"{where}: wrong keys {sorted(unknown)}, or no column")
        if "column" in entry:
            return {target: self._input(log, str(entry["column"]), entry, lead)}
        columns = entry["columns"]
        names = expand(columns) if isinstance(columns, str) else list(columns)
        return {f"{target}[{i}]": self._input(log, column, entry, lead)
                for i, column in enumerate(names, 1)}  # fmt: skip

    def _input(self, log: Log, column: str, entry: Mapping[str, Any], lead: float) -> Table:
        values = log[column]
        if "quantum" in entry:  # a count with a little noise on top: the count is exact
            quantum = float(entry["quantum"])
            values = np.rint(values / quantum) * quantum
        values = values * float(entry.get("gain", 1.0))
        times = snapped(log.time + lead, float(self.table["step"]))
        how = str(entry.get("interpolation", "hold"))
        if how == "slope":  # of the interval that begins
            values, how = np.append(np.diff(values) / np.diff(times), 0.0), "hold"
            before = 0.0
        elif how == "window":  # mean over the interval that ends
            values, how = np.append(values[1:], values[-1]), "hold"
            before = float(values[0])
        else:
            before = float(values[0])
        if times[0] > 0.0:
            times, values = np.append(0.0, times), np.append(before, values)
        if "period" in self.table:  # recorded points may pass the last sample
            times = np.append(times, times[-1] + float(self.table["period"]))
            values = np.append(values, values[-1])
        return Table(
            times,
            values,
            unit=str(entry.get("unit", "")),
            interpolation=how,  # type: ignore[arg-type]
            text=f"{log.name}:{column}",
        )
