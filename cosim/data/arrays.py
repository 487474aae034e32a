"""Tables of numbers: what Parquet, npz and MATLAB files hold, as columns."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ScenarioError
from .cells import Gaps, integers, numbers
from .matlab import read_matlab
from .npz import read_npz
from .parquet import read_table
from .text import Table, exact_of, spelled

Vector = NDArray[np.float64]
KINDS = "fiub"
"""Of arrays that hold real numbers: floating-point, whole with and without sign, truth values."""


def _floats(values: NDArray[Any]) -> tuple[Vector, int]:
    """Values of a column as floating-point numbers, and what was taken off all of them."""
    if values.dtype.kind in "iu" and values.itemsize == 8:
        return integers(values.tolist())
    return values.astype(np.float64), 0


def _add(table: Table, path: Path, name: str, values: NDArray[Any]) -> None:
    """A column, or the columns `name_1`, `name_2` of a table with one row per sample.

    Raises:
        ScenarioError: there is one of this name.
    """
    if values.ndim == 2:
        for index, column in enumerate(values.T, 1):
            _add(table, path, f"{name}_{index}", column)
    if values.ndim != 1:
        return
    if name in table.columns or name in table.texts:
        raise ScenarioError(f"{path}: has two columns {name!r}; rename one of the arrays")
    found, origin = _floats(values)
    found = np.where(np.isfinite(found), found, np.nan)
    lost = int(np.count_nonzero(np.isnan(found)))
    whole = values.tolist() if values.dtype.kind in "iu" and values.itemsize == 8 else None
    table.add(name, found, Gaps(empty=lost, count=found.size), origin, whole)


def parquet_table(path: Path) -> Table:
    """Read a Parquet file; text that is numbers is read as such, time stamps as seconds.

    Raises:
        ScenarioError: it is none, damaged or too large.
    """
    table, content = Table(), read_table(path)
    import pyarrow as pa

    for item in content.schema:
        column, kind = content[item.name], item.type
        unit = (item.metadata or {}).get(b"unit", b"").decode(errors="replace")
        try:
            if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
                unit = kind.unit
                column = column.cast(pa.int64())
            elif pa.types.is_boolean(kind):
                column = column.cast(pa.int8())
            elif pa.types.is_decimal(kind):
                column = column.cast(pa.float64())
            elif pa.types.is_string(kind) or pa.types.is_large_string(kind):
                cells = ["" if cell is None else cell for cell in column.to_pylist()]
                found, gaps, origin = numbers(cells)
                table.add(item.name, found, gaps, origin, exact_of(cells, gaps))
                table.units[item.name] = unit
                continue
            elif not (pa.types.is_floating(kind) or pa.types.is_integer(kind)):
                held = Gaps(strange=1, example=f"of type {kind}", row=1, count=1)
                if pa.types.is_binary(kind) and not column.null_count:
                    table.exact[item.name] = column.to_pylist()
                table.texts[item.name] = held
                continue
        except (pa.ArrowException, ValueError) as error:
            raise ScenarioError(
                f"{path}: column {item.name!r} of type {kind} holds no numbers ({error}); write "
                "numbers"
            ) from error
        _add(table, path, item.name, column.to_numpy())
        table.units[item.name] = spelled(unit) or unit
    return table


def _text(cell: str | bytes) -> str:
    return cell if isinstance(cell, str) else cell.decode("latin-1")


def npz_table(path: Path) -> Table:
    """Read an npz archive; of arrays of text, such whose cells are numbers.

    Raises:
        ScenarioError: it is none, damaged or too large.
    """
    table = Table()
    for name, values in read_npz(path).items():
        if values.dtype.kind in KINDS:
            _add(table, path, name, values)
        elif values.dtype.kind in "US" and values.ndim == 1:
            table.add(name, *numbers([_text(cell) for cell in values.tolist()]))
        elif values.dtype.kind in "mM" and values.ndim == 1:
            _add_times(table, name, values)
        elif values.ndim:
            what = f"of type {values.dtype} in {values.ndim} dimensions"
            table.notes.append(f"array {name!r} {what} holds no columns and is left out")
    return table


def _add_times(table: Table, name: str, values: NDArray[Any]) -> None:
    """A column of dates or durations, as whole numbers of its unit."""
    unit, _ = np.datetime_data(values.dtype)
    unit = unit if unit in ("s", "ms", "us", "ns") else "ns"  # days and months are exact so, too
    good = ~np.isnat(values)
    whole = values.astype(f"{values.dtype.kind}8[{unit}]").astype(np.int64)
    known, origin = integers(whole[good].tolist())
    found = np.full(values.shape, np.nan)
    found[good] = known
    lost = int(values.size - known.size)
    exact = whole.tolist() if not lost else None
    table.add(name, found, Gaps(empty=lost, count=values.size), origin, exact)
    table.units[name] = unit


def matlab_table(path: Path) -> Table:
    """Read a MATLAB file; a matrix becomes columns `name_1`, `name_2`, a structure `name.field`.

    Raises:
        ScenarioError: it is none, damaged or too large.
    """
    table, left = Table(), dict[str, str]()
    for name, values in read_matlab(path, left).items():
        _add(table, path, name, values)
    if left:
        what = ", ".join(f"{name!r} ({kind})" for name, kind in left.items())
        table.notes.append(f"{what}: holds no columns of numbers and is left out")
    return table
