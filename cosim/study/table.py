"""The table of a study: one row per run, and what the runs of one variant have in common."""

from __future__ import annotations

import csv
import json
import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..data.comparison import Reference, compare
from ..data.recording import Recording
from ..errors import UnknownNameError
from ..files import atomic
from ..spec.distribution import needed
from .planning import StudyPlan, Task
from .store import Store

if TYPE_CHECKING:
    import pandas as pd

Vector = NDArray[np.float64]
_UNITS = {"step": "s", "simulated": "s", "wall": "s", "cpu": "s", "energy_residual": "J"}
ERRORS = ("rms.", "error.")
"""Beginnings of the columns that say how far a run is from something."""


@dataclass
class StudyTable:
    """Rows with the same columns; what a run does not have is None.

    Attributes:
        rows: one per run, in the order of the study.
        units: of columns that have one.
    """

    rows: list[dict[str, Any]]
    units: dict[str, str] = field(default_factory=dict)

    @property
    def columns(self) -> list[str]:
        """All of them, in order."""
        kinds = ("set.", "param.", *ERRORS, "max.", "error_max.", "check.")
        found = list(dict.fromkeys(name for row in self.rows for name in row))
        ranked = {name: next((i for i, k in enumerate(kinds) if name.startswith(k)), -1)
                  for name in found}  # fmt: skip
        plain = [name for name in found if ranked[name] < 0]
        made, measured = plain[: plain.index("step") + 1], plain[plain.index("step") + 1 :]
        inner = sorted((name for name in found if ranked[name] >= 0), key=ranked.__getitem__)
        first = [name for name in inner if ranked[name] < 2]
        errors = [name for name in inner if ranked[name] >= 2]
        return [*made, *first, *errors, *measured]

    @property
    def varied(self) -> list[str]:
        """Columns that say what a run was made with and are not the same in all."""
        names = ["scenario", "algorithm", "step"]
        names += [name for name in self.columns if name.startswith(("set.", "param."))]
        order = [name for name in self.columns if name in names]
        return [n for n in order if len({_key(row.get(n)) for row in self.rows}) > 1]

    @property
    def errors(self) -> list[str]:
        """Columns that say how far a run is from something."""
        return [name for name in self.columns if name.startswith(ERRORS)]

    def variants(self) -> list[dict[str, Any]]:
        """One row for the runs that differ in parameters only: their number, errors and cost."""
        keys = [name for name in self.varied if not name.startswith("param.")]
        groups: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
        for row in self.rows:
            groups.setdefault(tuple(_key(row.get(name)) for name in keys), []).append(row)
        found, errors = [], self.errors
        for rows in groups.values():
            done = [row for row in rows if row["status"] == "ok"]
            item: dict[str, Any] = {name: rows[0].get(name) for name in keys}
            item.update(runs=len(rows), failed=len(rows) - len(done))
            for name in errors:
                values = [row[name] for row in done if row.get(name) is not None]
                item[name] = statistics.median(values) if values else None
                item[f"worst.{name}"] = max(values) if values else None
            for name in ("wall", "cpu", "fmu_steps", "x_real_time"):
                values = [row[name] for row in done if row.get(name) is not None]
                item[name] = statistics.median(values) if values else None
            found.append(item)
        return found

    def to_pandas(self) -> pd.DataFrame:
        """A data frame; units are in its `attrs`.

        Raises:
            InputError: pandas is not installed.
        """
        pd = needed("pandas", "a study's table as data frame", "tables")
        frame = pd.DataFrame(
            {name: [_cell(row.get(name)) for row in self.rows] for name in self.columns}
        )
        frame.attrs["units"] = dict(self.units)
        return frame

    def write_csv(self, path: Path) -> Path:
        """Write a CSV file whose head names each column with its unit, `step [s]`."""
        columns = self.columns
        with atomic(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(
                f"{name} [{self.units[name]}]" if self.units.get(name) else name for name in columns
            )
            for row in self.rows:
                cells = (_cell(row.get(name)) for name in columns)
                writer.writerow("" if cell is None else cell for cell in cells)
        return path

    def write_parquet(self, path: Path) -> Path:
        """Write a Parquet file; unit in each column's metadata.

        Raises:
            InputError: pyarrow is not installed.
        """
        pq = needed("pyarrow.parquet", f"{path}: writing Parquet", "tables")
        import pyarrow as pa

        arrays, fields = [], []
        for name in self.columns:
            cells = [_cell(row.get(name)) for row in self.rows]
            if {type(cell) for cell in cells} - {type(None)} > {str}:
                cells = [None if cell is None else str(cell) for cell in cells]
            arrays.append(pa.array(cells))
            metadata = {"unit": self.units[name]} if self.units.get(name) else None
            fields.append(pa.field(name, arrays[-1].type, metadata=metadata))
        with atomic(path) as temporary:
            pq.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields)), temporary)
        return path


def _cell(value: Any) -> Any:
    """A vector as text."""
    return json.dumps(value) if isinstance(value, (list, dict)) else value


def _key(value: Any) -> Any:
    return repr(value) if isinstance(value, (list, dict)) else value


def tabulate(plan: StudyPlan, store: Store) -> StudyTable:
    """The table of the runs that are there; recordings are read one by one."""
    table = StudyTable([], dict(_UNITS))
    by_reference: dict[str, list[int]] = {}
    for task in plan.tasks.values():
        result = store.read(task.key)
        if result is None:
            continue
        if task.reference and result["channels"] is not None and result["status"] == "ok":
            by_reference.setdefault(task.reference, []).append(len(table.rows))
        table.rows.append(_row(task, result, table.units))
    for key, indices in by_reference.items():
        found = store.read(key)
        if found is None or found["channels"] is None or found["status"] != "ok":
            continue
        reference = store.recording(key)
        for index in indices:
            row = table.rows[index]
            recording = reference if row["key"] == key else store.recording(row["key"])
            _compare(row, recording, reference, plan.signals, table.units)
    return table


def _row(task: Task, result: Mapping[str, Any], units: dict[str, str]) -> dict[str, Any]:
    simulated, wall, error = result["simulated_s"], result["wall_s"], result["error"]
    done = result["status"] == "ok"
    row: dict[str, Any] = {
        "key": task.key,
        "role": "" if task.designed else "reference",
        "status": result["status"],
        "scenario": result["scenario"],
        "algorithm": str(task.point.algorithm or result["algorithm"]),
        "step": result["step_s"],
        **{f"set.{name}": value for name, value in task.point.variants.items()},
        **{f"param.{name}": value for name, value in task.point.parameters.items()},
        "simulated": simulated,
        "wall": wall,
        "cpu": result["cpu_s"],
        "fmu_steps": result["fmu_steps"],
        "x_real_time": simulated / wall if done and wall else None,
        "energy_residual": result["energy_residual_J"],
        "checks_failed": sum(check["ok"] is False for check in result["checks"]) if done else None,
    }
    for name, item in result["comparison"].items():
        for of in ("rms", "max"):
            row[f"{of}.{name}"], units[f"{of}.{name}"] = _finite(item[of]), item["unit"]
    for check in result["checks"]:
        row[f"check.{check['name']}"], units[f"check.{check['name']}"] = (
            _finite(check["value"]), check["unit"],
        )  # fmt: skip
    row["error"] = error["text"] if error else ""
    return row


def _finite(value: float | None) -> float | None:
    """None for what JSON cannot write."""
    return value if value is not None and math.isfinite(value) else None


def _compare(
    row: dict[str, Any],
    recording: Recording,
    reference: Recording,
    signals: Sequence[str],
    units: dict[str, str],
) -> None:
    for name in signals:
        try:
            columns = [recording.names[column] for column in recording.find(name)]
            values = reference[name]
        except UnknownNameError:
            continue  # a variant that has no such signal; the run's notes say so
        found = compare(
            recording,
            Reference(
                tuple(columns), reference.time, values.reshape(len(reference.time), -1),
                reference.units.get(columns[0], ""), "reference run",
            ),
        )  # fmt: skip
        for of, value in (("error", found.rms), ("error_max", found.max)):
            row[f"{of}.{name}"], units[f"{of}.{name}"] = value, found.unit
