"""Tables of numbers: Parquet, npz and MATLAB files, unpacked once their size is known."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ScenarioError
from .cells import Gaps, integers, numbers
from .text import Table, spelled, too_large

Vector = NDArray[np.float64]
KINDS = "fiub"
"""Of arrays that hold real numbers: floating-point, whole with and without sign, truth values."""


def _floats(values: NDArray[Any]) -> tuple[Vector, int]:
    """Values of an array as floating-point numbers, and what was taken off all of them."""
    if values.dtype.kind in "iu" and values.ndim == 1 and values.itemsize == 8:
        return integers(values.tolist())
    return values.astype(np.float64), 0


def _add(table: Table, name: str, values: NDArray[Any]) -> None:
    """A column, or the columns `name_1`, `name_2` of a table with one row per sample."""
    found, origin = _floats(values)
    if values.ndim == 1:
        found = np.where(np.isfinite(found), found, np.nan)
        lost = int(np.count_nonzero(np.isnan(found)))
        table.add(name, found, Gaps(empty=lost, count=found.size), origin)
    elif values.ndim == 2:
        for index, column in enumerate(found.T, 1):
            _add(table, f"{name}_{index}", np.ascontiguousarray(column))


def read_parquet(path: Path, limit: int) -> Table:
    """Read a Parquet file; text that is numbers is read as such, time stamps as seconds.

    Raises:
        ScenarioError: it is none, or too large.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = Table()
    try:
        meta = pq.read_metadata(path)
        groups = [meta.row_group(i) for i in range(meta.num_row_groups)]
        size = sum(group.total_byte_size for group in groups)
        # run lengths pack a column of equal values to nothing, so rows count, too
        size = max(size, 8 * meta.num_rows * meta.num_columns)
        if size > limit:
            raise ScenarioError(too_large(path, size, limit))
        content = pq.read_table(path)
        for item in content.schema:
            column = content[item.name]
            stamp = pa.types.is_timestamp(item.type) or pa.types.is_duration(item.type)
            unit = (item.metadata or {}).get(b"unit", b"").decode(errors="replace")
            if stamp:
                unit = item.type.unit
                column = column.cast(pa.int64())
            elif pa.types.is_boolean(item.type):
                column = column.cast(pa.int8())
            elif pa.types.is_decimal(item.type):
                column = column.cast(pa.float64())
            elif pa.types.is_string(item.type) or pa.types.is_large_string(item.type):
                cells = ["" if cell is None else cell for cell in column.to_pylist()]
                table.add(item.name, *numbers(cells))
                table.units[item.name] = unit
                continue
            elif not (pa.types.is_floating(item.type) or pa.types.is_integer(item.type)):
                kind = f"of type {item.type}"
                table.texts[item.name] = Gaps(strange=1, example=kind, row=1, count=1)
                continue
            _add(table, item.name, column.to_numpy())
            table.units[item.name] = spelled(unit) or unit
    except (pa.ArrowException, OSError, ValueError) as error:
        raise ScenarioError(f"{path}: is not a Parquet file ({error})") from error
    return table


def read_npz(path: Path, limit: int) -> Table:
    """Read an npz archive; arrays that hold no numbers are known by their names only.

    Raises:
        ScenarioError: it is none, is cut off, or too large.
    """
    table = Table()
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(item.file_size for item in archive.infolist())
        if size > limit:
            raise ScenarioError(too_large(path, size, limit))
        with np.load(path) as content:
            for name in content.files:
                values = content[name]
                if not isinstance(values, np.ndarray):
                    raise ScenarioError(f"{path}: its entry {name!r} is not an array of numpy")
                if values.dtype.kind in KINDS:
                    _add(table, name, values)
                elif values.dtype.kind in "US" and values.ndim == 1:
                    table.add(name, *numbers([str(cell) for cell in values]))
    except (ValueError, OSError, EOFError, KeyError, NotImplementedError, RuntimeError,
            SyntaxError, MemoryError, zipfile.BadZipFile, zlib.error) as error:  # fmt: skip
        raise ScenarioError(
            f"{path}: is not a whole npz archive of numbers ({error}); write it anew"
        ) from error
    return table


def read_mat(path: Path, limit: int) -> Table:
    """Read a MATLAB file of version 7 or older; a matrix becomes a column each, `name_1`, `name_2`.

    Raises:
        ScenarioError: it is none, or too large.
    """
    from scipy.io import loadmat, whosmat

    table = Table()
    try:
        size = sum(8 * int(np.prod(shape, dtype=object)) for _, shape, _ in whosmat(path))
        if size > limit:
            raise ScenarioError(too_large(path, size, limit))
        content = loadmat(path, squeeze_me=True)
    except ScenarioError:
        raise
    except Exception as error:  # scipy raises whatever its parser meets in a damaged file
        raise ScenarioError(
            f"{path}: is not a MATLAB file of version 7 or older ({error}); save it with -v7"
        ) from error
    for name, value in content.items():
        array = isinstance(value, np.ndarray) and value.dtype.kind in KINDS
        if array and not name.startswith("__"):
            _add(table, name, value)
    return table
