"""The samples of a stream as a data set: runs, description and mapping in one folder."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..calibrate.mapping import find_system
from ..errors import InputError
from ..files import make_folder, read_toml, write_text
from ..spec.distribution import needed
from .messages import Sample
from .reading import Reading

if TYPE_CHECKING:
    import pyarrow.parquet as pq

PURPOSES = ("identification", "validation")
"""Of the runs in turn, unless they say so."""
ROWS = 4096
"""Samples that are written at a time."""


class Folder:
    """A data set that grows while the stream runs; ready for `cosim diagnose` when closed.

    Args:
        place: where it shall be; made, and must hold no data set yet.
        reading: whose columns and mapping it has.

    Raises:
        InputError: pyarrow is not installed, or there is a data set already.
    """

    def __init__(self, place: Path, reading: Reading) -> None:
        self.place, self.reading = make_folder(place), reading
        for name in ("set.toml", "dataset.toml", "mapping", "runs"):
            if (place / name).exists():
                raise InputError(
                    f"{place}: has a {name} already, which the stream would be written over; "
                    "choose another folder with --out"
                )
        self._runs: list[dict[str, Any]] = []
        self._parquet = needed("pyarrow.parquet", f"{place}: writing Parquet", "tables")
        self._writer: pq.ParquetWriter | None = None
        self._columns: list[str] = []
        self._waiting: list[Sample] = []
        self._span = (0.0, 0.0)

    @property
    def begun(self) -> bool:
        """Whether there is a run in it."""
        return bool(self._runs)

    def begin(self, entries: Mapping[str, Any], first: Sample) -> str:
        """Begin a run; its name."""
        self.end()
        name = str(entries.get("name", f"R{len(self._runs) + 1}"))
        if name in {run["name"] for run in self._runs}:
            name = f"{name}_{len(self._runs) + 1}"
        file = f"runs/{len(self._runs) + 1:03d}.parquet"
        purpose = entries.get("purpose", PURPOSES[len(self._runs) % len(PURPOSES)])
        kept = {k: v for k, v in entries.items() if k not in ("name", "file", "files", "purpose")}
        self._runs.append({"name": name, "file": file, "purpose": purpose, **kept})
        clock = self.reading.clock
        columns = dict.fromkeys([*first.values, *self.reading.sources()])  # some may begin late
        self._columns = [clock, *(column for column in columns if column != clock)]
        import pyarrow as pa

        schema = pa.schema([(column, pa.float64()) for column in self._columns])
        make_folder(self.place / "runs")
        self._writer = self._parquet.ParquetWriter(self.place / file, schema)
        self._span = (first.time, first.time)
        return name

    def add(self, samples: Sequence[Sample]) -> None:
        """Keep samples."""
        self._waiting += samples
        if samples:
            self._span = (self._span[0], samples[-1].time)
        if len(self._waiting) >= ROWS:
            self._flush()

    def _flush(self) -> None:
        if self._writer is None or not self._waiting:
            return
        begin = self._span[0]
        import pyarrow as pa

        arrays = [pa.array(np.array([sample.time - begin for sample in self._waiting]))]
        arrays += [
            pa.array(np.array([sample.values.get(c, math.nan) for sample in self._waiting]))
            for c in self._columns[1:]
        ]
        self._writer.write_table(pa.table(arrays, names=self._columns))
        self._waiting = []

    def end(self) -> None:
        """End the run under way."""
        self._flush()
        if self._writer is not None:
            self._writer.close()
            self._writer = None
            self._runs[-1]["duration_s"] = round(self._span[1] - self._span[0], 9)

    def close(self) -> Path:
        """Write the description and the mapping; the folder."""
        self.end()
        joined = self.reading.joined
        lines = []
        if (joined.data.folder / "set.toml").is_file():
            lines = [f"rig = {_toml(joined.data.rig)}", f"set = {_toml(self.place.name)}"]
            described = read_toml(joined.data.folder / "set.toml")
            if "sheet" in described:
                sheet = str(described["sheet"])
                for folder in (joined.data.folder, *joined.data.folder.parents[:2]):
                    if (folder / sheet).is_file():
                        shutil.copyfile(folder / sheet, self.place / Path(sheet).name)
                        break
                lines.append(f"sheet = {_toml(Path(sheet).name)}")
            lines.append(f"sample_rate_hz = {1.0 / self.reading.interval:.12g}")
            lines.append(f"columns = {_toml(self._columns)}")
        runs = [line for run in self._runs for line in ("", "[[run]]", *_pairs(run))]
        mapping = self._mapping()
        if lines:
            write_text(self.place / "set.toml", "\n".join([*lines, *runs, ""]))
            runs = []
        write_text(self.place / "dataset.toml", "\n".join([*mapping, *runs, ""]))
        return self.place

    def _mapping(self) -> list[str]:
        """The mapping with those that it is based on, and its system, copied beside."""
        joined = self.reading.joined
        path, copies = joined.path, make_folder(self.place / "mapping")
        lines = [f"base = {_toml(f'mapping/{path.name}')}"]
        name = str(joined.table.get("system", ""))
        if name.endswith(".toml"):
            shutil.copyfile(find_system(path, name).path, copies / Path(name).name)
            lines.append(f"system = {_toml(f'mapping/{Path(name).name}')}")
        while True:
            shutil.copyfile(path, copies / path.name)
            base = read_toml(path).get("base")
            if base is None:
                return lines
            path = path.parent / str(base)


def _pairs(table: Mapping[str, Any]) -> list[str]:
    """Lines of a table; TOML has no null, what is null is left out."""
    return [f"{_key(key)} = {_toml(value)}" for key, value in table.items() if value is not None]


def _key(key: str) -> str:
    return key if key.replace("_", "").replace("-", "").isalnum() and key.isascii() else _toml(key)


def _toml(value: Any) -> str:
    """A value in TOML, whose texts, lists and numbers are those of JSON."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(_pairs(value)) + " }"
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return repr(math.nan if value is None else value)
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False)
