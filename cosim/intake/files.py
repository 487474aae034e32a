"""The logs of a data set to be: copied as they are, or each topic in a file of its own."""

from __future__ import annotations

import csv
import filecmp
import shutil
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, count
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..calibrate.stamps import since_1970
from ..files import atomic, make_folder, writing
from ..spec.distribution import has
from ..spec.units import parse
from .clock import Clock
from .grouping import plain
from .runs import Part, Run

Vector = NDArray[np.float64]
Whole = NDArray[np.int64]
Good = NDArray[np.bool_]
LOGS = "logs"


def known_clock(part: Part) -> bool:
    """Whether a mapping knows the unit of a clock: from its head, or as time since 1970."""
    clock, log = part.report.clock, part.report.topic.log
    if log.units.get(clock.column):
        return True
    size = abs(float(np.nanmedian(log[clock.column]))) + log.origins.get(clock.column, 0)
    return since_1970(size) == clock.unit.unit != "s"


def readable(parts: Sequence[Part]) -> bool:
    """Whether a mapping reads the files of a run as they are: tables whose clocks fit together."""
    if not all(part.plain and part.report.clock.column for part in parts):
        return False
    if len(parts) == 1:
        return True
    seconds = [p.report.clock.unit.unit == "s" and not known_clock(p) for p in parts]
    alike = {p.report.clock.column for p in parts}
    return all(seconds) or (not any(seconds) and all(map(known_clock, parts)) and bool(alike))


def clock_column(part: Part, whole: bool) -> str:
    """Name of the clock in the file of a data set."""
    return part.report.clock.column if whole else "time"


def place(runs: Sequence[Run], folder: Path, whole: bool) -> dict[str, dict[str, str]]:
    """Put the logs of runs into a folder, each under a name of its own.

    Args:
        runs: with their parts.
        folder: of the data set.
        whole: copy files as they are; else each part becomes a Parquet file, or CSV where pyarrow
            is not installed.

    Returns:
        Path of each part's file, relative to the folder, by run.
    """
    make_folder(folder / LOGS)
    found: dict[str, dict[str, str]] = {run.name: {} for run in runs}
    taken = {_known_as(part.path) for run in runs for part in run.parts.values()}
    end = ".parquet" if has("pyarrow") else ".csv"
    for run in runs:
        for key, part in run.parts.items():
            if whole:
                target = _copied(part.path, folder / LOGS, plain(run.name))
            else:
                name = plain(f"{run.name}_{key}" if key else run.name)
                paths = (folder / LOGS / f"{one}{end}" for one in _numbered(name))
                target = next(path for path in paths if _known_as(path) not in taken)
                write_part(part, target)
                taken.add(_known_as(target))
            found[run.name][key] = target.relative_to(folder).as_posix()
    return found


def _known_as(path: Path) -> str:
    """A path as file systems see it that do not tell small letters from capitals."""
    return str(path.resolve()).casefold()


def _numbered(name: str) -> Iterator[str]:
    """A name, and others like it."""
    yield name
    yield from (f"{name}_{number}" for number in count(2))


def _copied(path: Path, folder: Path, run: str) -> Path:
    """A file in a folder, under a name that no other content has there."""
    names = chain([path.name], (f"{one}_{path.name}" for one in _numbered(run)))
    target = next(
        t for t in (folder / name for name in names)
        if not t.exists() or filecmp.cmp(path, t, shallow=False)
    )  # fmt: skip
    if not target.exists():
        with writing(target):
            shutil.copyfile(path, target)
    return target


def write_part(part: Part, path: Path) -> None:
    """Write a part: its clock as `time` [ns], its columns with their units.

    Args:
        part: what is written.
        path: of a Parquet file, or of a table of text with a row of units.
    """
    topic, clock = part.report.topic, part.report.clock
    origin = topic.log.origins.get(clock.column, 0)
    times, good = nanoseconds(topic.log[clock.column], origin, clock)
    columns = {c.name: topic.log[c.name] for c in part.report.columns}
    units = [c.unit.unit if c.unit.sure else "" for c in part.report.columns]
    with atomic(path) as temporary:
        write = _write_parquet if path.suffix == ".parquet" else _write_text
        write(temporary, times, good, columns, units)


def _write_parquet(
    path: Path, times: Whole, good: Good, columns: Mapping[str, Vector], units: Sequence[str]
) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    fields = [pa.field("time", pa.int64(), metadata={"unit": "ns"})]
    arrays = [pa.array(times, pa.int64(), mask=~good)]
    for (name, values), unit in zip(columns.items(), units, strict=True):
        fields.append(pa.field(name, pa.float64(), metadata={"unit": unit}))
        arrays.append(pa.array(values, pa.float64()))
    pq.write_table(pa.table(arrays, schema=pa.schema(fields)), path)


def _write_text(
    path: Path, times: Whole, good: Good, columns: Mapping[str, Vector], units: Sequence[str]
) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time", *columns])
        writer.writerow(["ns", *(unit if unit not in ("", "1") else "-" for unit in units)])
        for time, known, *row in zip(times, good, *columns.values(), strict=True):
            cells = [repr(float(v)) if np.isfinite(v) else "" for v in row]
            writer.writerow([int(time) if known else "", *cells])


def nanoseconds(values: Vector, origin: int, clock: Clock) -> tuple[Whole, Good]:
    """Times as whole nanoseconds, exact where the log was, and which of them are known.

    In seconds if the unit is unknown.
    """
    factor = round(parse(clock.unit.unit or "s").factor / 1e-9)
    good = np.isfinite(values)
    whole = np.rint(np.where(good, values, 0.0) * factor).astype(np.int64) + origin * factor
    return whole, good
