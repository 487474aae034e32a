"""Measured data: one run's columns (`Log`), and folders of runs with a rig sheet (`DataSet`).

A data set is a folder with `set.toml` (rig, sheet, runs with file and purpose) and, beside it or
up to two folders above, the rig sheet that it names, which gives the columns' units and noise.
Plain CSV, Parquet and npz files are logs too; CSV heads such as `speed [rad/s]` carry units.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ScenarioError, UnknownNameError, listing
from ..files import is_file, read_toml
from ..limits import DATA
from .matlab import read_matlab
from .npz import read_npz
from .parquet import read_table

Vector = NDArray[np.float64]
_CELL = 8
"""Bytes of memory per byte of a CSV file: seven digits are a text of 56 and a pointer."""
_TRUTH = {"true": 1.0, "True": 1.0, "TRUE": 1.0, "false": 0.0, "False": 0.0, "FALSE": 0.0}
_INTEGERS = 2.0**53
"""From here on doubles skip integers."""
_HEAD = re.compile(r"(?P<name>.*?)\s*\[(?P<unit>[^\]\d][^\]]*)\]")


@dataclass(frozen=True)
class Log:
    """Columns over time.

    Attributes:
        name: of the run or file, for texts.
        columns: by name; gaps are NaN.
        units: by column; "" where unknown.
        noise: standard deviation by column, where the rig sheet gives it.
        values: further entries of the run in `set.toml`, e.g. start values and purpose.
        exact: columns that doubles do not carry: texts, which are in no other place, and integers
            beyond 2^53.
    """

    name: str
    columns: Mapping[str, Vector]
    units: Mapping[str, str] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)
    exact: Mapping[str, list[Any]] = field(default_factory=dict)

    def __getitem__(self, column: str) -> Vector:
        """A column.

        Raises:
            UnknownNameError: with the nearest names.
        """
        if column not in self.columns and column in self.exact:
            raise UnknownNameError(
                f"{self.name}: column {column!r} holds texts such as {self.exact[column][0]!r}, "
                "and numbers are needed"
            )
        if column not in self.columns:
            raise UnknownNameError(
                f"{self.name}: has no column {column!r}; {listing(self.columns, column)}"
            )
        return self.columns[column]

    @property
    def time(self) -> Vector:
        """Sample times [s]."""
        return self["time"]


Read = tuple[dict[str, Vector], dict[str, str], dict[str, list[Any]]]
"""Columns, their units, and those that doubles do not carry."""


def _csv(path: Path) -> Read:
    if excess := DATA.excess(_CELL * path.stat().st_size):
        raise ScenarioError(f"{path}: {excess}")
    try:
        with path.open(encoding="utf-8-sig", newline="") as handle:
            rows = [row for row in csv.reader(handle) if row and not row[0].startswith("#")]
    except (csv.Error, UnicodeError) as error:
        raise ScenarioError(
            f"{path}: is not a table of text ({error}); save it as CSV in UTF-8"
        ) from error
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read ({error.strerror})") from error
    if not rows:
        raise ScenarioError(f"{path}: is empty")
    units, names = {}, []
    for head in rows[0]:
        match = _HEAD.fullmatch(head.strip())
        name = match["name"] if match else head.strip()
        names.append(name)
        units[name] = match["unit"] if match else ""
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ScenarioError(f"{path}: has two columns {twice!r}; rename one of them")
    columns: dict[str, Vector] = {}
    exact: dict[str, list[Any]] = {}
    for index, name in enumerate(names):
        texts = [row[index].strip() if index < len(row) else "" for row in rows[1:]]
        if any(texts) and all(text in _TRUTH for text in texts):
            columns[name] = np.array([_TRUTH[text] for text in texts])
            continue
        try:
            columns[name] = np.array([float(text) if text else np.nan for text in texts])
        except ValueError:
            exact[name] = texts
            continue
        if np.any(np.abs(columns[name]) >= _INTEGERS):
            with suppress(ValueError):  # they are no integers
                exact[name] = [int(text) for text in texts]
    return columns, units, exact


def _parquet(path: Path) -> Read:
    import pyarrow as pa

    table = read_table(path)
    columns, units = {}, {}
    exact: dict[str, list[Any]] = {}
    for item in table.schema:
        number = pa.types.is_floating(item.type) or pa.types.is_integer(item.type)
        whole = not table[item.name].null_count
        if number or (pa.types.is_boolean(item.type) and whole):
            columns[item.name] = table[item.name].to_numpy().astype(np.float64)
            units[item.name] = (item.metadata or {}).get(b"unit", b"").decode(errors="replace")
        if whole and (
            pa.types.is_string(item.type)
            or pa.types.is_large_string(item.type)
            or pa.types.is_binary(item.type)
            or (pa.types.is_integer(item.type) and np.any(np.abs(columns[item.name]) >= _INTEGERS))
        ):
            exact[item.name] = table[item.name].to_pylist()
    return columns, units, exact


def _split(name: str, values: Vector) -> dict[str, Vector]:
    """A column, or the columns `name_1`, `name_2` of a table with one row per sample."""
    if values.ndim == 1:
        return {name: values}
    if values.ndim == 2:
        return {f"{name}_{i}": column for i, column in enumerate(values.T, 1)}
    return {}


def _numbers(arrays: Mapping[str, NDArray[Any]], path: Path) -> dict[str, Vector]:
    """Arrays of numbers as columns.

    Raises:
        ScenarioError: two of one name.
    """
    columns: dict[str, Vector] = {}
    for name, array in arrays.items():
        if array.dtype.kind not in "fiub":
            continue
        for one, values in _split(name, array.astype(np.float64)).items():
            if one in columns:
                raise ScenarioError(f"{path}: has two columns {one!r}; rename one of the arrays")
            columns[one] = values
    return columns


def _npz(path: Path) -> Read:
    return _numbers(read_npz(path), path), {}, {}


def _mat(path: Path) -> Read:
    return _numbers(read_matlab(path), path), {}, {}


_READERS = {".csv": _csv, ".parquet": _parquet, ".npz": _npz, ".mat": _mat}


def read_log(path: Path | str, *, units: Mapping[str, str] | None = None) -> Log:
    """Read a CSV, Parquet, npz or MATLAB file.

    Raises:
        ScenarioError: missing or unreadable.
    """
    path = Path(path)
    if not is_file(path):
        raise ScenarioError(f"{path}: there is no such file")
    reader = _READERS.get(path.suffix)
    if reader is None:
        raise ScenarioError(f"{path}: logs are {', '.join(_READERS)} files")
    columns, found, exact = reader(path)
    return Log(path.name, columns, {**found, **(units or {})}, exact=exact)


@dataclass(frozen=True)
class LoggedRun:
    """An entry of `set.toml`.

    Attributes:
        name: of the run.
        file: path of its log.
        purpose: identification or validation.
        values: all entries, e.g. start values.
    """

    name: str
    file: Path
    purpose: str
    values: Mapping[str, Any]


@dataclass(frozen=True)
class DataSet:
    """A folder of runs.

    Attributes:
        folder: where it is.
        name, rig: as in `set.toml`.
        runs: by name.
        sheet: content of the rig sheet.
        units, noise: of the columns, from the sheet.
    """

    folder: Path
    name: str
    rig: str
    runs: Mapping[str, LoggedRun]
    sheet: Mapping[str, Any]
    units: Mapping[str, str]
    noise: Mapping[str, float]

    def log(self, run: str) -> Log:
        """Read a run.

        Raises:
            UnknownNameError: no such run.
            ScenarioError: its file is missing or unreadable.
        """
        if run not in self.runs:
            raise UnknownNameError(f"data set {self.name}: {listing(self.runs, run)} as run")
        entry = self.runs[run]
        log = read_log(entry.file, units=self.units)
        return replace(log, name=f"{self.name}/{run}", noise=self.noise, values=entry.values)


def _sheet(folder: Path, name: str) -> dict[str, Any]:
    for place in (folder, folder.parent, folder.parent.parent):
        if is_file(place / name):
            return read_toml(place / name)
    raise ScenarioError(
        f"{folder / 'set.toml'}: the rig sheet {name!r} is not here nor in the two folders above"
    )


def read_data_set(folder: Path | str) -> DataSet:
    """Read a data set's description; the logs are read when asked for.

    Raises:
        ScenarioError: `set.toml` or the sheet is missing or wrong.
    """
    folder = Path(folder)
    table = read_toml(folder / "set.toml")
    sheet = _sheet(folder, str(table["sheet"])) if "sheet" in table else {}
    try:
        runs = {
            entry["name"]: LoggedRun(
                entry["name"], folder / entry["file"], entry.get("purpose", ""), dict(entry)
            )
            for entry in table.get("run", [])
        }
        signals = sheet.get("signal", [])
        units = {entry["name"]: entry.get("unit", "") for entry in signals}
        noise = {entry["name"]: float(entry.get("noise_sigma", 0.0)) for entry in signals}
        if not all(isinstance(name, str) for name in (*runs, *units, *units.values())):
            raise TypeError("a name or unit is no text")
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ScenarioError(f"{folder / 'set.toml'}: an entry is incomplete ({error})") from error
    return DataSet(
        folder,
        table.get("set", folder.name),
        table.get("rig", ""),
        runs,
        sheet,
        units,
        noise,
    )
