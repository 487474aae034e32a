"""Scenarios: a system, its variants and parameters, inputs, duration and what to compare.

Read from `scenario.toml`; docs/scenarios.md has the schema. A scenario may describe several runs:
named ones (`[runs.NAME]`, each a set of changes to the rest) or one per row of a table.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..data.comparison import Reference, circle
from ..data.logs import Log, read_data_set, read_log
from ..data.signals import Constant, Signal, SignalVector, Table
from ..errors import ScenarioError, UnknownNameError, listing, within
from ..files import flatten, is_file, overlay, read_toml
from ..installation import places
from ..reading.limits import DATA
from ..system.toml import SystemFile, read_system
from .axes import Axes, FigureSpec, read_axes, read_figure
from .checks import CHECK_KEYS, Check, read_check
from .run_table import fill, table_runs
from .shape import check_inside, check_outside

KEYS = {
    "description", "question", "expected", "source", "system", "duration", "start", "step",
    "algorithm", "options", "tolerance", "variants", "parameters", "inputs", "record", "compare",
    "checks", "runs", "table", "plot", "plots", "figures",
}  # fmt: skip
_SOURCE_KEYS = {"file", "data", "run", "column", "columns", "time", "unit", "constant", "times",
                "values", "interpolation"}  # fmt: skip
_WAYS = ("constant", "times", "file", "data", "circle")
"""Keys of a source, each of which says where values come from."""
_CIRCLE_KEYS = {"start", "centre", "rate"}


@dataclass(frozen=True)
class Scenario:
    """One run, ready to be built.

    Attributes:
        name: `folder` or `folder/run`.
        folder: against which its files are taken.
        text, question, expected, source: what it is about.
        system: the graph, before variants are changed.
        duration, start, step: [s].
        algorithm: name of the co-simulation algorithm.
        options: of the algorithm.
        tolerance: handed to the FMUs, None for their own.
        variants: changes to the system's variants, in short forms.
        parameters: full name -> value.
        inputs: input -> signal.
        record: signals, None for all outputs.
        also: signals that are recorded besides.
        period: time between recorded points [s], None for every communication point.
        references: what is compared, by name.
        checks: what must hold.
        plot: signals to plot, None for the compared ones, else all.
        plots: axes of the plot with labels, instead of `plot`.
        figures: pictures that `cosim figures` makes.
    """

    name: str
    folder: Path
    text: str
    question: str
    expected: str
    source: str
    system: SystemFile
    duration: float
    start: float
    step: float
    algorithm: str
    tolerance: float | None
    variants: Mapping[str, str]
    parameters: Mapping[str, Any]
    inputs: Mapping[str, Signal | SignalVector]
    record: tuple[str, ...] | None
    period: float | None
    references: Mapping[str, Reference]
    checks: tuple[Check, ...]
    plot: tuple[str, ...] | None
    plots: tuple[Axes, ...] = ()
    figures: tuple[FigureSpec, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    also: tuple[str, ...] = ()


@dataclass(frozen=True)
class ScenarioFile:
    """A `scenario.toml` with the runs that it describes.

    Attributes:
        name: its folder's name (with folders above it, below `scenarios`).
        path: the file.
        table: its content.
        runs: run name -> changes; one unnamed run ("") if it describes none.
    """

    name: str
    path: Path
    table: Mapping[str, Any]
    runs: Mapping[str, Mapping[str, Any]]
    logs: dict[str, Log] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """Its description."""
        return str(self.table.get("description", ""))

    def scenario(self, run: str = "") -> Scenario:
        """One of its runs.

        Raises:
            UnknownNameError: no such run.
            ScenarioError: a wrong key or value.
        """
        if run not in self.runs:
            raise UnknownNameError(f"{self.path}: {listing(self.runs, run)} as run, not {run!r}")
        return _Reader(self, run).read()


def find(name: str, folder: Path | None = None) -> tuple[ScenarioFile, str]:
    """The scenario file that `name` means, and the run ("" for all).

    Args:
        name: `motor_bench`, `crawler_paper/SET1_1`, a folder with a scenario.toml, or a .toml file.
        folder: where scenarios are looked for; the library's by default.

    Raises:
        UnknownNameError: there is none.
    """
    if name.endswith(".toml"):
        return read_scenario(Path(name)), ""
    folder = folder or places.scenarios()
    parts = name.strip("/").split("/")
    for place in (folder, Path()):
        for length in range(len(parts), 0, -1):
            path = place.joinpath(*parts[:length]) / "scenario.toml"
            if is_file(path):
                run = "/".join(parts[length:])
                return read_scenario(path, "/".join(parts[:length])), run
    known = [item.name for item in scenario_files(folder)]
    raise UnknownNameError(f"there is no scenario {name!r}; {listing(known, name)}")


def scenario_files(folder: Path | None = None) -> list[ScenarioFile]:
    """All scenarios below a folder, by default the library's."""
    folder = folder or places.scenarios()
    return [
        read_scenario(path, path.parent.relative_to(folder).as_posix())
        for path in sorted(folder.rglob("scenario.toml"))
    ]


def read_scenario(path: Path | str, name: str = "") -> ScenarioFile:
    """Read a scenario file.

    Raises:
        ScenarioError: not TOML, or a wrong key.
    """
    path = Path(path)
    table = read_toml(path)
    _only(path, table, KEYS, "a scenario")
    check_outside(table, str(path))
    runs: dict[str, Mapping[str, Any]] = {}
    if "table" in table:
        with within(str(path)):
            rows = table_runs(path, table["table"])
        runs.update({run: {"": row} for run, row in rows.items()})
    for run, changes in table.get("runs", {}).items():
        _only(path, changes, KEYS - {"runs", "table"}, f"run {run}")
        check_outside(changes, f"{path}, run {run}")
        runs[run] = {**runs.get(run, {}), **changes}
    return ScenarioFile(name or path.parent.name, path, table, runs or {"": {}})


def _only(path: Path, table: Mapping[str, Any], known: set[str], what: str) -> None:
    unknown = set(table) - known
    if unknown:
        first = sorted(unknown)[0]
        raise ScenarioError(f"{path}: {what} has no key {first!r}; {listing(sorted(known), first)}")


def _merge(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    merged = dict(copy.deepcopy(base))
    for key, value in changes.items():
        if key in ("parameters", "inputs", "variants", "compare", "record"):
            theirs = merged.get(key, {})
            merged[key] = (
                overlay(flatten(theirs), flatten(value)) if key == "parameters"
                else {**theirs, **value}
            )  # fmt: skip
        elif key == "checks":
            merged[key] = [*merged.get(key, []), *value]
        else:
            merged[key] = value
    return merged


class _Reader:
    """Reads one run of a scenario file."""

    def __init__(self, file: ScenarioFile, run: str) -> None:
        self.file, self.run = file, run
        self.folder = file.path.parent
        changes = dict(file.runs[run])
        row = {"name": run, **changes.pop("", {})}
        base = {key: value for key, value in file.table.items() if key not in ("runs", "table")}
        self.table = fill(str(file.path), _merge(base, changes), row)

    def fail(self, text: str) -> ScenarioError:
        return ScenarioError(f"{self.where}: {text}")

    @property
    def where(self) -> str:
        return f"{self.file.path}" + (f", run {self.run}" if self.run else "")

    def number(self, key: str, default: float | None = None) -> float:
        value = self.table.get(key, default)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self.fail(f"{key} must be a number, not {value!r}")
        return float(value)

    def read(self) -> Scenario:
        with within(self.where):
            return self.whole()

    def whole(self) -> Scenario:
        table = self.table
        check_inside(table, self.where)
        record = table.get("record", {})
        _only(self.file.path, record, {"signals", "period"}, "[record]")
        inputs: dict[str, Signal | SignalVector] = {}
        for name, entry in table.get("inputs", {}).items():
            inputs[name] = self.signal(name, entry)
        references = {
            name: self.reference(name, entry) for name, entry in table.get("compare", {}).items()
        }
        checks = []
        for entry in table.get("checks", []):
            _only(self.file.path, entry, CHECK_KEYS, "a check")
            try:
                checks.append(read_check(entry, references))
            except ValueError as error:
                raise self.fail(str(error)) from error
        system = self.system()
        for check in checks:
            for name in check.holds_for or ():
                if name not in system.instances:
                    raise self.fail(
                        f"check {check.name!r}: holds_for names no instance {name!r}; "
                        f"{listing(system.instances, name)}"
                    )
        period = self.optional(record, "period")
        signals = record.get("signals")
        return Scenario(
            name=self.file.name + (f"/{self.run}" if self.run else ""),
            folder=self.folder,
            text=table.get("description", ""),
            question=table.get("question", ""),
            expected=table.get("expected", ""),
            source=table.get("source", ""),
            system=system,
            duration=self.number("duration"),
            start=self.number("start", 0.0),
            step=self.number("step"),
            algorithm=str(table.get("algorithm", "jacobi")),
            tolerance=self.optional(table, "tolerance"),
            variants=dict(table.get("variants", {})),
            parameters=flatten(table.get("parameters", {})),
            inputs=inputs,
            record=None if signals is None else tuple(signals),
            period=period,
            references=references,
            checks=tuple(checks),
            plot=tuple(table["plot"]) if "plot" in table else None,
            plots=tuple(self.axes(entry) for entry in table.get("plots", [])),
            figures=tuple(self.figure(entry) for entry in table.get("figures", [])),
            options=dict(table.get("options", {})),
        )

    def axes(self, entry: Any) -> Axes:
        try:
            axes = read_axes(entry)
            self.known(axes)
            return axes
        except ValueError as error:
            raise self.fail(str(error)) from error

    def known(self, axes: Axes) -> None:
        for name in axes.comparisons:
            if name not in self.table.get("compare", {}):
                raise ValueError(f"plot {axes.label!r}: there is no comparison {name!r}")

    def figure(self, entry: Any) -> FigureSpec:
        try:
            found = read_figure(entry)
            if not found.runs or self.run in found.runs:
                for axes in found.plots:
                    self.known(axes)
        except ValueError as error:
            raise self.fail(str(error)) from error
        for run in found.runs:
            if run not in self.file.runs:
                raise self.fail(f"figure {found.name!r}: {listing(self.file.runs, run)} as run, "
                                f"not {run!r}")  # fmt: skip
        return found

    def optional(self, table: Mapping[str, Any], key: str) -> float | None:
        return float(table[key]) if key in table else None

    def system(self) -> SystemFile:
        name = self.table.get("system")
        if not isinstance(name, str):
            raise self.fail('system = "name" is missing')
        if name.endswith(".toml"):
            return read_system(self.folder / name)
        for folder in (self.folder, *self.folder.parents):
            path = folder / "systems" / f"{name}.toml"
            if is_file(path):
                return read_system(path)
        path = places.scenarios() / "systems" / f"{name}.toml"
        if is_file(path):
            return read_system(path)
        known = [item.stem for item in sorted((places.scenarios() / "systems").glob("*.toml"))]
        raise UnknownNameError(
            f"{self.file.path}: there is no system {name!r}; {listing(known, name)}"
        )

    # -- data --------------------------------------------------------------------------------------

    def log(self, entry: Mapping[str, Any]) -> Log:
        run = str(entry.get("run", self.run))
        key = f"{entry.get('data', '')}|{run}|{entry.get('file', '')}"
        if key not in self.file.logs:
            if "data" in entry:
                data = read_data_set(self.folder / entry["data"])
                self.file.logs[key] = data.log(run)
            else:
                self.file.logs[key] = read_log(self.folder / entry["file"])
        return self.file.logs[key]

    def samples(
        self, what: str, entry: Any, column: str, *, exact: bool = False
    ) -> tuple[Any, Any, str, str]:
        """Times, values, unit and text of a column of a log, or of an inline table.

        Args:
            what: needs them, for error texts.
            entry: says where they are.
            column: of the log.
            exact: as they are, where doubles do not carry them.
        """
        if "times" in entry:
            if "values" not in entry:
                raise self.fail(f"{what}: times without values")
            return entry["times"], entry["values"], entry.get("unit", ""), f"{what}: table"
        if "constant" in entry:
            times = self.grid()
            value = np.full_like(times, float(entry["constant"]))
            return times, value, entry.get("unit", ""), f"{what}: constant"
        if "file" not in entry and "data" not in entry:
            raise self.fail(
                f"{what}: give constant, times and values, file and column, or data and column"
            )
        log = self.log(entry)
        unit = entry.get("unit", log.units.get(column, ""))
        text = f"{log.name}:{column}"
        times = log.seconds(str(entry.get("time", "time")))
        if exact and column in log.exact:
            return times, log.exact[column], unit, text
        values = log[column]
        if origin := log.origins.get(column):
            values = values + float(origin)
        return times, values, unit, text

    def one_way(self, what: str, entry: Mapping[str, Any]) -> None:
        """Refuse two sources at once."""
        ways = [key for key in _WAYS if key in entry]
        if len(ways) > 1:
            raise self.fail(f"{what}: has {' and '.join(ways)}; give one source")

    def signal(self, name: str, entry: Any) -> Signal | SignalVector:
        """The signal of an input, or those of all elements of a vector input."""
        if isinstance(entry, (int, float, str, list)):
            entry = {"constant": entry}
        if not isinstance(entry, dict):
            raise self.fail(f"input {name}: {entry!r} is neither a value nor a table")
        _only(self.file.path, entry, _SOURCE_KEYS, f"input {name}")
        self.one_way(f"input {name}", entry)
        if "constant" in entry:
            value, unit = entry["constant"], str(entry.get("unit", ""))
            rows = value if isinstance(value, list) else [value]
            items = [item for row in rows for item in (row if isinstance(row, list) else [row])]
            for item in items:
                if not isinstance(item, (int, float, str)):
                    raise self.fail(f"input {name}: {item!r} is neither a number nor a text")
            constants = tuple(Constant(item, unit) for item in items)
            return SignalVector(constants) if isinstance(value, list) else constants[0]
        hold = entry.get("interpolation", "hold")
        columns = entry.get("columns")
        if columns is None:
            if {"file", "data"} & set(entry) and not {"column", "times"} & set(entry):
                known = listing(self.log(entry).columns, name.rpartition(".")[2])
                raise self.fail(f"input {name}: column is missing; {known}")
            return self.table_signal(f"input {name}", entry, str(entry.get("column")), hold)
        return SignalVector(
            tuple(self.table_signal(f"input {name}", entry, column, hold) for column in columns)
        )

    def table_signal(self, what: str, entry: Any, column: str, hold: Any) -> Table:
        times, values, unit, text = self.samples(what, entry, column, exact=hold == "hold")
        return Table(
            times, values, unit=unit, interpolation=hold, text=text, extend="times" in entry
        )

    def reference(self, name: str, entry: Any) -> Reference:
        if not isinstance(entry, dict) or not {"signal", "signals"} & set(entry):
            raise self.fail(f"compare {name}: signal is missing")
        keys = _SOURCE_KEYS | {"signal", "signals", "offset", "scale", "circle", "name"}
        _only(self.file.path, entry, keys, f"compare {name}")
        self.one_way(f"compare {name}", entry)
        signals = tuple(entry.get("signals", [entry.get("signal")]))
        text = str(entry.get("name", ""))
        if "circle" in entry:
            return self.circle(name, entry["circle"], signals, text)
        columns = entry.get("columns", [entry.get("column", name)])
        if len(columns) != len(signals):
            raise self.fail(
                f"compare {name}: {len(columns)} columns for {len(signals)} signals; give as many"
            )
        parts = [self.samples(f"compare {name}", entry, str(column)) for column in columns]
        values = np.column_stack([np.asarray(part[1], dtype=np.float64) for part in parts])
        offset = entry.get("offset", 0.0)
        if isinstance(offset, str):
            known = self.log(entry).values
            if offset not in known:
                raise self.fail(
                    f"compare {name}: offset {offset!r} is no entry of the run; "
                    f"{listing(known, offset)}"
                )
            offset = known[offset]
        return Reference(
            signals,
            np.asarray(parts[0][0], dtype=np.float64),
            (values - float(offset)) * float(entry.get("scale", 1.0)),
            parts[0][2],
            text or ", ".join(part[3] for part in parts),
        )

    def grid(self) -> Any:
        """Times of the recorded points."""
        period = self.optional(self.table.get("record", {}), "period") or self.number("step")
        count = self.number("duration") / period if period > 0.0 else -1.0
        if not 0.0 <= count <= DATA.value() / 8:
            raise self.fail(
                f"duration = {self.number('duration'):g} s in periods of {period:g} s gives no "
                "times; give a duration and a period (or step) above 0 that fit together"
            )
        count = round(count)
        return self.number("start", 0.0) + period * np.arange(count + 1, dtype=np.float64)

    def circle(self, name: str, entry: Any, signals: tuple[str, ...], text: str) -> Reference:
        what = f"compare {name}"
        _only(self.file.path, entry, _CIRCLE_KEYS, f"{what}, circle")
        if len(signals) != 2 or set(entry) != _CIRCLE_KEYS:
            raise self.fail(f"{what}: a circle takes two signals, start, centre and rate")
        times = self.grid()
        points = circle(times - times[0], entry["start"], entry["centre"], float(entry["rate"]))
        return Reference(signals, times, points, "", text or f"{what}: circle")
