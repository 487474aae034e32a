"""Parquet tables, with their size known before anything is unpacked."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import ScenarioError
from ..reading.limits import DATA
from ..spec.distribution import needed

if TYPE_CHECKING:
    import pyarrow as pa


def read_table(path: Path) -> pa.Table:
    """Read a Parquet file.

    Raises:
        ScenarioError: missing, damaged, too large, or with two columns of one name.
        InputError: pyarrow is not installed.
    """
    if not path.is_file():
        raise ScenarioError(f"{path}: there is no such file")
    pq = needed("pyarrow.parquet", f"{path}: reading Parquet", "tables")
    import pyarrow as pa

    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            # runs of equal values take next to nothing in the file: rows count
            size = max(8 * file.metadata.num_rows * file.metadata.num_columns, path.stat().st_size)
            if excess := DATA.excess(size):
                raise ScenarioError(f"{path}: its columns are too large: {excess}")
            table = file.read(use_threads=False)
            table.validate(full=True)
    except (pa.ArrowException, OSError, ValueError, KeyError, TypeError, OverflowError) as error:
        # some of Arrow's errors are Python's own classes, too
        raise ScenarioError(
            f"{path}: is not a whole Parquet file ({_short(error)}); write it again"
        ) from error
    names = table.column_names
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ScenarioError(f"{path}: has two columns {twice!r}; rename one of them")
    return table


def _short(error: Exception) -> str:
    """The first line of an error: Arrow's may show the file's bytes."""
    text: Any = str(error).splitlines() or [type(error).__name__]
    return str(text[0])[:200]
