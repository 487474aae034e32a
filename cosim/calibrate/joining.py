"""Joins a mapping and a data set: channels, parameters and runs of a calibration problem."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data.logs import Log
from ..data.segments import relative_pose
from ..data.signals import Table
from ..errors import ScenarioError, UnitError, UnknownNameError, listing, within
from ..files import flatten
from ..master.master import Master
from ..spec.units import Unit, parse, per_second
from ..system.provider import Provider, get_ready
from ..system.toml import SystemFile
from .between import Parts, between
from .checks.finding import Finding, Source, check_allowed
from .checks.undriven import check_undriven, mappings
from .clocks import bounds, check_clock, clock_unit, masked
from .columns import expand
from .counts import steady, whole_counts
from .entries import lookup
from .mapped_logs import MappedLogs
from .model import Model
from .named import FIRST, named, read_first, readings
from .parts import (
    BIAS,
    CLOCK,
    COINCIDENT,
    COLUMN,
    Channel,
    MeasuredRun,
    Parameter,
    check_parameters,
)
from .problem import Problem
from .recorder import check_column, column_unit
from .scales import known, scaled, to_unit, zeroed
from .stamps import apart
from .steps import steps

Vector = NDArray[np.float64]


def snapped(times: Vector, step: float) -> Vector:
    """Times on the grid of communication steps where they miss it by no more than rounding.

    A set value whose time is a rounding error late would otherwise act one step late.
    """
    if times.size < 2:
        return times
    nearest = np.rint(times / step) * step
    near = np.abs(times - nearest) <= COINCIDENT * float(np.median(np.diff(times)))
    return np.asarray(np.where(near, nearest, times), dtype=np.float64)


class Joined(MappedLogs):
    """Makes a problem of a mapping and a data set (arguments as of `MappedLogs`)."""

    def problem(self, file: SystemFile, provider: Provider) -> Problem:
        """The problem, on a system."""
        table = self.table
        model = Model.of(file, provider)
        get_ready(provider, model.instances.values())
        self.system = model.plain({})
        self.algorithm = str(table.get("algorithm", "jacobi"))
        self.options = dict(table.get("options", {}))
        search, tick = steps(table, str(self.path))
        for options in (self.options, {**self.options, **search.options}):
            with within(str(self.path)):  # what the master refuses is said before data are read
                Master(self.system, self.algorithm, search.step, options=options).compile([], [])
        self.constants: dict[str, float] = {}
        constants = self.constants
        for name, value in flatten(table.get("parameters", {})).items():
            if isinstance(value, list):
                constants.update({f"{name}[{i}]": float(v) for i, v in enumerate(value, 1)})
            else:
                constants[name] = float(value)
        fixed = self.data.sheet.get("fixed", {})
        for key, entry in table.get("fixed", {}).items():
            value = lookup(fixed, key, f"{self.path}: [fixed]")
            constants.update({name: factor * value for name, factor in
                              named(entry, f"{self.path}: {key}")})  # fmt: skip
        self.columns: dict[str, str] = {}
        self.converted: dict[str, tuple[float, float]] = {}
        self.told: set[str] = set()  # channels whose noise the mapping states
        present = [
            self.channel(one, {**entry, "signal": entry["signal"].replace("{}", str(i))})
            for name, entry in table["channels"].items()
            for i, one in enumerate(expand(name), 1)
            if self._measured_somewhere(one, entry)
        ]
        if not present:
            raise ScenarioError(f"{self.path}: no channel's column is in the logs")
        self.channel_units = {channel.name: channel.unit for channel in present}
        stated = [*self.declared(), *self.others()]
        check_parameters(stated)
        self.late = {name: bounds(stated, name) for name in self.logs}
        parameters = [p for p in stated if not p.late]
        runs = [self.run(name, present) for name in self.logs]
        settled = {*constants, *(n for p in stated for n, _ in p.targets)}.union(
            *(run.starts for run in runs)
        )
        self.findings += check_undriven(
            self.system, [target for target, _, _ in self.drivers()], settled, self.logs,
            self.units, mappings(self.table, self.path),
        )  # fmt: skip
        return Problem(
            self.data.name,
            model,
            parameters,
            present,
            runs,
            float(table["step"]),
            search,
            constants=constants,
            algorithm=self.algorithm,
            options=self.options,
            period=float(table["period"]) if "period" in table else None,
            tick=tick,
            relative=[tuple(names) for names in self.table.get("relative", [])],
            late=[p for p in stated if p.late],
            source=self._source(present),
            readings=readings(self.table, f"{self.path}: [readings]"),
            read_off=self._read_off(present),
        )

    def _read_off(self, present: list[Channel]) -> dict[str, dict[str, float]]:
        """Zero of a column -> starts that are read off it, with the factors into their units."""
        columns = {self.columns[c.name]: c.name for c in present}
        found: dict[str, dict[str, float]] = {}
        for column, entry, unit, where in read_first(self.table, str(self.path)):
            if column in columns:
                own, channel = self.units.get(column, ""), columns[column]
                targets = self.targets(entry, own if unit is None else unit, where)
                gain = to_unit(own, unit or "", where)[0] / self.converted[channel][0]
                found.setdefault(BIAS + channel, {}).update({n: gain * f for n, f in targets})
        return found

    def _source(self, present: list[Channel]) -> Source:
        """Where the data come from, for their checks."""
        cut = any({"rows", "each"} & set(run.values) for run in self.data.runs.values())
        return Source(
            self.path,
            tuple(self.findings),
            check_allowed(self.table.get("checks", {}).get("allow", []), self.path),
            self.data.rate,
            as_logged="resample" not in self.table and not cut,
            made=frozenset(c.name for c in present if self._made(self.columns[c.name])),
            instruments=frozenset(
                c.name for c in present
                if self.columns[c.name] in self.noise and c.name not in self.told
            ),
        )  # fmt: skip

    def _made(self, column: str) -> bool:
        """Whether a column is filtered, or brought to another clock."""
        for pattern, entry in self.table.get("columns", {}).items():
            if column in expand(pattern):
                other = entry.get("time", self.table.get("time", "time")) != self.table.get(
                    "time", "time"
                )
                return other or bool({"lowpass", "derivative", "late", "hold"} & set(entry))
        return "resample" in self.table

    def _measured_somewhere(self, name: str, entry: Mapping[str, Any]) -> bool:
        """Whether a channel's column is in a log; whether it may be absent.

        Raises:
            UnknownNameError: it is in none and nothing says that it need not be.
            ScenarioError: it holds text.
        """
        column = str(entry.get("column", name))
        without = [one for one, log in self.logs.items() if column not in log.columns]
        for one in without:
            if column in self.logs[one].texts:
                self.logs[one][column]  # says so
        if not without:
            return True
        unlisted = bool(self.data.listed) and column not in self.data.listed
        if not (unlisted or entry.get("optional", False)):
            log = self.logs[without[0]]
            raise UnknownNameError(
                f"{self.path}: channel {name}: {log.name} has no column {column!r}; "
                f"{listing(log.columns, column)}; a channel that not every log has is "
                "optional = true"
            )
        where = "any run" if len(without) == len(self.logs) else ", ".join(without)
        text = f"is not compared: its column {column!r} is not in {where}"
        self.findings.append(Finding("note", "absent", "", name, text))
        return len(without) < len(self.logs)

    def _unit(self, name: str, where: str) -> Unit | None:
        """Unit of a variable of the system.

        Raises:
            UnknownNameError: there is none such.
        """
        try:
            return self.system.variables(name)[1][0].unit
        except UnknownNameError as error:
            raise UnknownNameError(f"{where}: {error}") from None

    def _column(self, channel: Channel) -> str:
        return self.columns[channel.name]

    def channel(self, name: str, entry: Mapping[str, Any]) -> Channel:
        """One measured column."""
        where = f"{self.path}: channel {name}"
        column = str(entry.get("column", name))
        self.columns[name] = column
        own = self.units.get(column, "")
        unit = str(entry.get("unit", own))
        here = known(unit, where) if unit else None
        measured = known(own, f"{where}: column {column}") if own and here else None
        self.converted[name] = scaled(
            measured, here, None, f"{where}: column {column}", "scale", ""
        )
        signal = self._unit(str(entry["signal"]), where)
        if signal is not None and entry.get("transform") == "difference":
            signal = parse(per_second(signal.symbol)) if signal.symbol else None
        gain, offset = scaled(
            signal, here, entry.get("gain"), where, "gain",
            f"convert the column in [columns], to unit = {signal.symbol if signal else ''!r}",
        )  # fmt: skip
        sigma = abs(self.converted[name][0]) * self.noise.get(column, 0.0)
        sigma = float(entry.get("sigma", sigma))
        if "sigma" in entry:
            self.told.add(name)
        rounding = float(entry.get("quantum", 0.0)) ** 2 / 12.0 * int(entry.get("roundings", 1))
        sigma = math.sqrt(sigma**2 + rounding)
        if not sigma > 0.0:
            raise ScenarioError(f"{where}: its noise is not known; give sigma")
        if (by := str(entry.get("by", ""))) and by not in self.system.members:
            raise UnknownNameError(f"{where}: by: {listing(self.system.members, by)}")
        return Channel(
            name,
            unit,
            sigma,
            str(entry["signal"]),
            gain,
            zeroed(offset, float(entry.get("offset", 0.0))),
            str(entry.get("transform", "sample")),
            float(entry.get("window", 0.0)),
            float(entry.get("shift", 0.0)),
            by,
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
            where = f"{self.path}: [sheet] {name}"
            targets = self.targets(mapped[name], str(entry.get("unit", "")), where)
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
                targets = self.targets(entry["targets"], str(entry.get("unit", "")), where)
                runs = list(self.logs) if entry.get("per_run") else [""]
                if isinstance(entry["nominal"], str) and not entry.get("per_run"):
                    raise ScenarioError(
                        f"{where}: nominal {entry['nominal']!r} is another one in each run; "
                        "write per_run = true, or a number"
                    )
                for run in runs:
                    nominal = self.value(entry["nominal"], run, where, str(entry.get("unit", "")))
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

    def targets(self, entry: Any, unit: str, where: str) -> tuple[tuple[str, float], ...]:
        """Variables that a value in this unit sets, with the factors into theirs.

        Those that the system lacks may belong to variants that a diagnosis tries.
        """
        found = []
        source = known(unit, where) if unit else None
        for name, factor in named(entry, where):
            if name.startswith(CLOCK):
                inputs = [target for target, _, _ in self.drivers()]
                check_clock(name, self.columns, inputs, where)
            elif name.startswith(COLUMN):
                check_column(name, self.columns, where)
            wanted = self._wanted(name)
            given = factor if isinstance(entry, Mapping) else None
            way = f"state it in {wanted.symbol if wanted else ''!r}"
            gain, offset = scaled(source, wanted, given, f"{where}: {name}", "its factor", way)
            if offset:
                raise UnitError(f"{where}: {name}: {unit!r} has another zero; {way}")
            found.append((name, gain))
        return tuple(found)

    def _wanted(self, name: str) -> Unit | None:
        """Unit of a target, None where that is unknown."""
        if name.startswith(CLOCK):
            return clock_unit(name)
        if name.startswith(COLUMN):
            return column_unit(name, self.channel_units)
        try:
            return self.system.variables(name)[1][0].unit
        except UnknownNameError:
            return None

    def value(self, entry: Any, run: str, where: str, unit: str = "") -> float:
        """A number, an entry of the run (`initial_pose[0]`), or a column's start (`first:x`).

        `begin:x` is an entry that tells when the log begins, for the simulation, which begins
        before it by `lead`.
        """
        if isinstance(entry, (int, float)):
            return float(entry)
        if entry.startswith("begin:"):
            begun = lookup(self.logs[run].values, entry.removeprefix("begin:"), where)
            return begun - float(self.table.get("lead", 0.0))
        if entry.startswith(FIRST):
            column = entry.removeprefix(FIRST)
            begun = self.first(run, column, where)
            gain, offset = to_unit(self.units.get(column, ""), unit, f"{where}: column {column}")
            return begun * gain + offset
        return lookup(self.logs[run].values, entry, where)

    def run(self, name: str, channels: list[Channel]) -> MeasuredRun:
        """One run."""
        log = self.logs[name]
        starts: dict[str, float] = {}
        unsure: dict[str, float] = {}
        sigma = {self.columns[c.name]: c.sigma / abs(self.converted[c.name][0]) for c in channels}
        for key, entry in self.table.get("starts", {}).items():
            where = f"{self.path}: [starts] {key}"
            value = self.value(key, name, where)
            column = key.removeprefix(FIRST) if key.startswith(FIRST) else ""
            own, noise = self.units.get(column, ""), sigma.get(column, 0.0)
            for target, factor in self.targets(entry, own, where):
                starts[target], unsure[target] = factor * value, abs(factor) * noise
        lead = float(self.table.get("lead", 0.0))
        during = log.time >= 0.0
        data = np.column_stack([self._measured(log, c)[during] for c in channels])
        set_here = {**self.constants, **starts}.items()
        late = {n.removeprefix(CLOCK): (v, v) for n, v in set_here if n.startswith(CLOCK)}
        late |= self.late[name]
        times = log.time[during]
        data = masked(times, data, channels, late, float(times[0]) - lead)
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
            times + lead,
            data,
            {
                target: self._input(log, target, column, entry, lead)
                for target, column, entry in self.drivers()
            },
            starts,
            log.values,
            lead,
            anchor,
            {t: self.conversion(t, c, e)[0] * self.input_noise(c, e)
             for t, c, e in self.drivers()},
            unsure=unsure,
        )  # fmt: skip

    def _measured(self, log: Log, channel: Channel) -> Vector:
        column = self.columns[channel.name]
        if column not in log.columns:
            return np.full(log.time.shape, np.nan)
        values = log[column]
        if values.shape != log.time.shape:
            raise ScenarioError(f"{self.path}: " + apart(log, column, "time", log.time.size))
        gain, offset = self.converted[channel.name]
        return values if (gain, offset) == (1.0, 0.0) else values * gain + offset

    def drivers(self) -> list[tuple[str, str, Mapping[str, Any]]]:
        """Each driven input, or element of one, with its column and its entry.

        Raises:
            ScenarioError: an entry names no column.
        """
        found: list[tuple[str, str, Mapping[str, Any]]] = []
        for target, said in self.table.get("inputs", {}).items():
            entry = {"column": said} if isinstance(said, str) else said
            if "column" in entry:
                found.append((target, str(entry["column"]), entry))
                continue
            if "columns" not in entry:
                raise ScenarioError(
                    f"{self.path}: input {target}: lacks 'column'; {listing(entry, 'column')}"
                )
            columns = entry["columns"]
            names = expand(columns) if isinstance(columns, str) else list(columns)
            found += [(f"{target}[{i}]", column, entry) for i, column in enumerate(names, 1)]
        return found

    def conversion(
        self, target: str, column: str, entry: Mapping[str, Any]
    ) -> tuple[float, float, str]:
        """Gain and offset of a column that drives an input, and the unit of what they give."""
        where = f"{self.path}: input {target}"
        own, wanted = self.units.get(column, ""), self._unit(target, where)
        unit, factor = str(entry.get("unit", "")), entry.get("gain")
        source = known(own, f"{where}: column {column}") if own else None
        if source is not None and entry.get("interpolation") == "slope":
            source = parse(per_second(own)) if own else None
        way = f"convert the column {column} in [columns]"
        if unit:
            return *scaled(source, known(unit, where), factor, where, "gain", way), unit
        return *scaled(source, wanted, factor, where, "gain", way), ""

    def _course(self, log: Log, column: str, lead: float) -> tuple[Vector, Vector]:
        """Times and values of what drives an input, where they are known.

        What is held on a clock of its own changes at its own times, not at those of the log.
        """
        if column not in log.own:
            good = np.isfinite(log[column])
            return log.time[good], log[column][good]
        times, values = log.own[column]
        first, last = min(float(log.time[0]), -lead), float(log.time[-1])
        begin = max(int(np.searchsorted(times, first, "right")) - 1, 0)
        mine = slice(begin, int(np.searchsorted(times, last, "right")))
        # the last value holds to the end of the log; of several at one time the last one counts
        times, values = np.append(times[mine], last), np.append(values[mine], values[mine][-1:])
        counts = np.append(np.diff(times) > 0.0, True)
        return times[counts], values[counts]

    def _input(
        self, log: Log, target: str, column: str, entry: Mapping[str, Any], lead: float
    ) -> Table:
        times, values = self._course(log, column, lead)
        if "quantum" in entry:  # a count with a little noise on top: the count is exact
            quantum = float(entry["quantum"])
            values = whole_counts(values / quantum)
            if entry.get("interpolation") == "window":
                values = steady(values, times)
            values = values * quantum
        parts = 1
        gain, offset, unit = self.conversion(target, column, entry)
        values = values * gain + offset if offset else values * gain
        times = snapped(times + lead, float(self.table["step"]))
        last = np.append(np.diff(times) > 0.0, True)  # of a burst of commands the last one counts
        times, values = times[last], values[last]
        how = str(entry.get("interpolation", "hold"))
        if how == "slope":  # of the interval that begins
            values, how = np.append(np.diff(values) / np.diff(times), 0.0), "hold"
            before = 0.0
        elif how == "window":  # mean over the interval that ends
            before, how = float(values[0]), "hold"
            times, values, parts = between(times, values, float(self.table["step"]))
        else:
            before = float(values[0])
        if times[0] > 0.0:
            times, values = np.append(0.0, times), np.append(before, values)
        if "period" in self.table:  # recorded points may pass the last sample
            times = np.append(times, times[-1] + float(self.table["period"]))
            values = np.append(values, values[-1])
        table = Parts(
            times, values, unit=unit, interpolation=how,  # type: ignore[arg-type]
            text=f"{log.name}:{column}",
        )  # fmt: skip
        table.parts = parts
        return table
