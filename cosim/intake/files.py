"""The logs of a data set to be: copied as they are, or each topic in a Parquet file of its own."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..calibrate.columns import EPOCHS
from ..files import atomic, make_folder, writing
from ..spec.distribution import needed
from ..spec.units import parse
from .clock import Clock
from .grouping import plain
from .runs import Part, Run

if TYPE_CHECKING:
    import pyarrow as pa

Vector = NDArray[np.float64]
LOGS = "logs"


def known_clock(part: Part) -> bool:
    """Whether a mapping knows the unit of a clock: from its head, or as time since 1970."""
    clock, log = part.report.clock, part.report.topic.log
    if log.units.get(clock.column):
        return True
    size = abs(float(np.nanmedian(log[clock.column]))) + log.origins.get(clock.column, 0)
    return any(size >= least for least, _ in EPOCHS)


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


def place(run: Run, folder: Path, whole: bool) -> dict[str, str]:
    """Put the logs of a run into a folder.

    Args:
        run: with its parts.
        folder: of the data set.
        whole: copy files as they are; else each part becomes a Parquet file.

    Returns:
        Path of each part's file, relative to the folder.
    """
    make_folder(folder / LOGS)
    found = {}
    for key, part in run.parts.items():
        if whole:
            target = folder / LOGS / part.path.name
            if target.exists() and target.resolve() != part.path.resolve():  # of another folder
                target = folder / LOGS / f"{plain(run.name)}_{part.path.name}"
            if part.path.resolve() != target.resolve():
                with writing(target):
                    shutil.copyfile(part.path, target)
        else:
            name = plain(f"{run.name}_{key}" if key else run.name)
            target = folder / LOGS / f"{name}.parquet"
            write_part(part, target)
        found[key] = target.relative_to(folder).as_posix()
    return found


def write_part(part: Part, path: Path) -> None:
    """Write a part as Parquet: its clock as `time` [ns], its columns with their units.

    Raises:
        InputError: pyarrow is not installed.
    """
    pq = needed("pyarrow.parquet", f"{path}: writing Parquet", "tables")
    import pyarrow as pa

    topic, clock = part.report.topic, part.report.clock
    fields, arrays = [], []
    origin = topic.log.origins.get(clock.column, 0)
    fields.append(pa.field("time", pa.int64(), metadata={"unit": "ns"}))
    arrays.append(nanoseconds(topic.log[clock.column], origin, clock))
    for column in part.report.columns:
        sure = column.unit.unit if column.unit.sure else ""
        fields.append(pa.field(column.name, pa.float64(), metadata={"unit": sure}))
        arrays.append(pa.array(topic.log[column.name], pa.float64()))
    with atomic(path) as temporary:
        pq.write_table(pa.table(arrays, schema=pa.schema(fields)), temporary)


def nanoseconds(values: Vector, origin: int, clock: Clock) -> pa.Array:
    """Times as whole nanoseconds, exact where the log was; in seconds if the unit is unknown."""
    import pyarrow as pa

    factor = round(parse(clock.unit.unit or "s").factor / 1e-9)
    good = np.isfinite(values)
    whole = np.rint(np.where(good, values, 0.0) * factor).astype(np.int64) + origin * factor
    return pa.array(whole, pa.int64(), mask=~good)
