"""Measured data: one run's columns (`Log`), and folders of runs with a rig sheet (`DataSet`).

A data set is a folder with `set.toml` (rig, sheet, runs with file and purpose) and, beside it or
up to two folders above, the rig sheet that it names, which gives the columns' units and noise.
Plain tables of text, Parquet, npz and MATLAB files are logs, too.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ScenarioError, UnitError, UnknownNameError, listing, within
from ..files import is_file, read_toml
from ..spec.units import conversion, parse
from .arrays import matlab_table, npz_table, parquet_table
from .cells import Gaps
from .dates import advice
from .text import text_table

Vector = NDArray[np.float64]
PURPOSES = ("identification", "validation")
SET_KEYS = ("rig", "set", "sheet", "run", "sample_rate_hz", "columns", "description")
RUN_KEYS = ("name", "file", "files", "purpose", "prefix", "rows", "interval", "each", "where",
            "window", "samples")  # fmt: skip
"""Keys of a run that mean something here; a mapping may ask for any other."""


@dataclass(frozen=True)
class Log:
    """Columns over time.

    Attributes:
        name: of the run or file, for texts.
        columns: by name; gaps are NaN.
        units: by column; "" where unknown.
        noise: standard deviation by column, where the rig sheet gives it.
        values: further entries of the run in `set.toml`, e.g. start values and purpose.
        gaps: cells without a number, of the columns that have such.
        texts: the same of columns that hold text, which are no signals.
        origins: what was taken off all values of a column so that the rest is exact.
        notes: what was assumed in reading.
        exact: values that doubles do not carry, as they are: texts, and integers beyond 2^53.
        own: times and values of columns that are held on a clock of their own.
    """

    name: str
    columns: Mapping[str, Vector]
    units: Mapping[str, str] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)
    gaps: Mapping[str, Gaps] = field(default_factory=dict)
    texts: Mapping[str, Gaps] = field(default_factory=dict)
    origins: Mapping[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    exact: Mapping[str, list[Any]] = field(default_factory=dict)
    own: Mapping[str, tuple[Vector, Vector]] = field(default_factory=dict)

    def __getitem__(self, column: str) -> Vector:
        """A column.

        Raises:
            UnknownNameError: with the nearest names.
            ScenarioError: it holds text, or numbers that may mean others.
        """
        if column in self.texts:
            held = self.texts[column]
            if held.fault:
                raise ScenarioError(f"{self.name}: column {column!r} {held.fault}")
            way = advice(held.example) or (
                "name another column, or write numbers (and nothing, or N/A, where none was "
                "measured)"
            )
            raise ScenarioError(f"{self.name}: column {column!r} holds text: {held}; {way}")
        if column not in self.columns:
            raise UnknownNameError(
                f"{self.name}: has no column {column!r}; {listing(self.columns, column)}"
            )
        return self.columns[column]

    @property
    def time(self) -> Vector:
        """Sample times [s]."""
        return self["time"]

    def seconds(self, clock: str) -> Vector:
        """A clock of the log as it was read [s]: its unit and origin are taken in.

        Raises:
            UnitError: its unit is no time.
        """
        values, unit = self[clock], self.units.get(clock, "")
        try:
            gain, _ = conversion(parse(unit or "s"), parse("s"))
        except UnitError as error:
            raise UnitError(
                f"{self.name}: clock {clock!r} is in {unit!r}, which is no time ({error}); name "
                "another column with time"
            ) from None
        return values * gain + self.origins.get(clock, 0) * gain


READERS = {
    ".csv": text_table, ".tsv": text_table, ".txt": text_table,
    ".parquet": parquet_table, ".npz": npz_table, ".mat": matlab_table,
}  # fmt: skip


def read_log(path: Path | str, *, units: Mapping[str, str] | None = None) -> Log:
    """Read a table of text, or a Parquet, npz or MATLAB file.

    Raises:
        ScenarioError: missing, unreadable or too large.
    """
    path = Path(path)
    if path.is_dir():
        raise ScenarioError(f"{path}: is a folder, not a log; name the files in it")
    if not is_file(path):
        near = _beside(path)
        beside = f"; in its folder {listing(near, path.name)}" if near else ""
        raise ScenarioError(f"{path}: there is no such file{beside}")
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise ScenarioError(f"{path}: logs are {', '.join(READERS)} files")
    table = reader(path)
    stated = {column: unit for column, unit in (units or {}).items() if unit}
    return Log(
        path.name, table.columns, {**table.units, **stated}, gaps=table.gaps,
        texts=table.texts, origins=table.origins, notes=tuple(table.notes), exact=table.exact,
    )  # fmt: skip


def _beside(path: Path) -> list[str]:
    """Names of the files of the same kind in its folder."""
    try:
        return sorted(item.name for item in path.parent.iterdir() if item.suffix == path.suffix)
    except (OSError, ValueError):  # nor is there such a folder
        return []


def joined(name: str, logs: Mapping[str, Log]) -> Log:
    """Several files of one run, each on its own clock, as one log with columns `FILE.COLUMN`.

    What was taken off large time stamps to keep them exact is made the same in all.
    """
    parts: dict[str, Any] = {
        of: {} for of in ("columns", "units", "gaps", "texts", "origins", "exact")
    }
    known = [origin for log in logs.values() for origin in log.origins.values()]
    common = min(known, default=0)
    notes: list[str] = []
    for key, log in logs.items():
        notes += [f"{key}: {note}" for note in log.notes]
        for of, found in parts.items():
            found.update({f"{key}.{column}": item for column, item in getattr(log, of).items()})
        for column, origin in log.origins.items():
            parts["columns"][f"{key}.{column}"] = log.columns[column] + float(origin - common)
            parts["origins"][f"{key}.{column}"] = common
    return Log(name, noise={}, values={}, notes=tuple(notes), **parts)


@dataclass(frozen=True)
class LoggedRun:
    """An entry of `set.toml`.

    Attributes:
        name: of the run.
        files: paths of its logs by name; a single one is named "".
        purpose: identification or validation.
        values: all entries, e.g. start values.
    """

    name: str
    files: Mapping[str, Path]
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
        rate: samples per second, where `set.toml` says so.
        listed: columns of the set, where `set.toml` says so.
        file: where its runs are listed, for errors; `set.toml` if None.
    """

    folder: Path
    name: str
    rig: str
    runs: Mapping[str, LoggedRun]
    sheet: Mapping[str, Any]
    units: Mapping[str, str]
    noise: Mapping[str, float]
    rate: float | None = None
    listed: tuple[str, ...] = ()
    file: Path | None = None

    def log(self, run: str) -> Log:
        """Read a run.

        Raises:
            UnknownNameError: no such run.
            ScenarioError: its file is missing or unreadable.
        """
        if run not in self.runs:
            raise UnknownNameError(f"data set {self.name}: {listing(self.runs, run)} as run")
        entry = self.runs[run]
        name = f"{self.name}/{run}"
        with within(f"{self.file or self.folder / 'set.toml'}: run {run}"):
            if "" in entry.files:
                log = read_log(entry.files[""], units=self.units)
            else:
                log = joined(name, {key: read_log(file) for key, file in entry.files.items()})
        return replace(log, name=name, noise=self.noise, values=entry.values)


def _sheet(folder: Path, name: str) -> dict[str, Any]:
    for place in (folder, folder.parent, folder.parent.parent):
        if is_file(place / name):
            return read_toml(place / name)
    raise ScenarioError(
        f"{folder / 'set.toml'}: the rig sheet {name!r} is not here nor in the two folders above"
    )


def misspelt(table: Mapping[str, Any], known: Iterable[str], where: str) -> None:
    """Refuse a key that stands where one of the known ones is missing and looks like it.

    Raises:
        ScenarioError: with what it was probably meant to be.
    """
    missing = [key for key in known if key not in table]
    for key in table:
        if key not in known and (near := get_close_matches(key, missing, n=1, cutoff=0.75)):
            raise ScenarioError(f"{where}: has {key!r}; did you mean {near[0]!r}?")


def runs_of(
    entries: Any, folder: Path, where: str, used: Iterable[str] = ()
) -> dict[str, LoggedRun]:
    """The runs that a list of tables describes.

    Args:
        entries: `[[run]]` of a file.
        folder: against which paths are taken.
        where: the file, for texts.
        used: further keys that a mapping asks for.

    Raises:
        ScenarioError: an entry is incomplete or wrong.
    """
    found: dict[str, LoggedRun] = {}
    if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
        raise ScenarioError(f"{where}: run is not a list of tables; begin each with [[run]]")
    for number, entry in enumerate(entries, 1):
        name = entry.get("name", "")
        place = f"{where}: run {name!r}" if name else f"{where}: the {number}. run"
        if not isinstance(name, str):
            raise ScenarioError(f"{place}: its name must be a text in quotes")
        misspelt(entry, {*RUN_KEYS, *used}, place)
        lacking = next((key for key in ("name", "purpose") if key not in entry), "")
        if not {"file", "files"} & set(entry):
            lacking = "file"
        if lacking:
            raise ScenarioError(f"{place} lacks {lacking!r}; {listing(entry, lacking)}")
        if name in found:
            raise ScenarioError(f"{place} is there twice; give each run a name of its own")
        purpose = entry["purpose"]
        if purpose not in PURPOSES:
            raise ScenarioError(
                f"{place}: its purpose {purpose!r} is not known; {listing(PURPOSES, str(purpose))}"
            )
        files = entry.get("files", {"": entry.get("file")})
        if not isinstance(files, dict) or not all(isinstance(f, str) for f in files.values()):
            raise ScenarioError(
                f"{place}: its files must be names = paths, e.g. file = 'a.csv' or "
                "files = { command = 'a.csv', pose = 'b.csv' }"
            )
        if "file" in entry and "files" in entry:
            raise ScenarioError(f"{place}: file and files exclude each other; give one of them")
        paths = {str(key): folder / file for key, file in files.items()}
        found[name] = LoggedRun(name, paths, purpose, dict(entry))
    return found


def read_data_set(folder: Path | str, used: Iterable[str] = ()) -> DataSet:
    """Read a data set's description; the logs are read when asked for.

    Args:
        folder: with `set.toml`.
        used: entries of runs that are asked for elsewhere.

    Raises:
        ScenarioError: `set.toml` or the sheet is missing or wrong.
    """
    folder = Path(folder)
    path = folder / "set.toml"
    table = read_toml(path)
    misspelt(table, SET_KEYS, str(path))
    sheet = _sheet(folder, str(table["sheet"])) if "sheet" in table else {}
    runs = runs_of(table.get("run", []), folder, str(path), used)
    try:
        signals = sheet.get("signal", [])
        units = {entry["name"]: entry.get("unit", "") for entry in signals}
        noise = {entry["name"]: float(entry.get("noise_sigma", 0.0)) for entry in signals}
        rate = float(table["sample_rate_hz"]) if "sample_rate_hz" in table else None
        listed = tuple(map(str, table.get("columns", [])))
        if not all(isinstance(name, str) for name in (*units, *units.values())):
            raise TypeError("a name or unit is no text")
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ScenarioError(
            f"{path}: an entry of it or of its sheet is wrong ({error!r}); a signal has a name, "
            "a unit and a noise_sigma"
        ) from error
    return DataSet(
        folder,
        str(table.get("set", folder.name)),
        str(table.get("rig", "")),
        runs,
        sheet,
        units,
        noise,
        rate,
        listed,
    )
