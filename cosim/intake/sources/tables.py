"""Plain tables: text, Parquet, npz and MATLAB files are one topic each."""

from __future__ import annotations

from pathlib import Path

from ...data.logs import read_log
from ..topic import Source, Topic

NAMES = {".csv": "CSV", ".tsv": "text", ".txt": "text", ".parquet": "Parquet", ".npz": "npz",
         ".mat": "MATLAB"}  # fmt: skip


def read(path: Path, topics: tuple[str, ...]) -> Source:
    """Read a table; it is one topic, whatever topics are wanted.

    Raises:
        ScenarioError: it is missing, damaged or too large.
    """
    kind = NAMES.get(path.suffix.lower(), "table")
    return Source(path, kind, (Topic(path.stem, kind, read_log(path)),))
