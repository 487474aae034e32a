"""One log, many runs: logs that hold several runs, and windows of a long one.

An entry `[[run]]` of a mapping may say how its file is to be taken apart:

- `prefix`: the columns whose names begin so, without it;
- `rows`: each row of its tables is a run of samples at `interval`;
- `each`: each value of a column is a run;
- `where`: of these rows or values only those for which a column has this value, is one of these, or
  is `even` or `odd`;
- `window`: pieces of this length, one after the other from the first sample on.

Pieces are named `NAME 0`, `NAME 1`, and so on.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ScenarioError
from .logs import Log

Vector = NDArray[np.float64]
_ROW = re.compile(r"(?P<stem>.+)_(?P<index>\d+)$")
ROUNDING = 1e-6
"""Fraction of a window within which a sample still belongs to it."""


def pieces(log: Log) -> Iterator[tuple[str, Log]]:
    """The runs that a log holds, by name.

    Raises:
        ScenarioError: the entry does not fit the log.
    """
    entry = log.values
    name = str(entry["name"])
    if "prefix" in entry:
        log = _with_prefix(log, str(entry["prefix"]))
    if "rows" in entry and "each" in entry:
        raise ScenarioError(f"{log.name}: rows and each exclude each other; give one of them")
    if entry.get("rows"):
        yield from ((f"{name} {row}", one) for row, one in _rows(log))
    elif "each" in entry:
        yield from ((f"{name} {value!r}", one) for value, one in _each(log, str(entry["each"])))
    else:
        yield name, log


def _with_prefix(log: Log, prefix: str) -> Log:
    """The columns whose names begin so, and what is said about them, without it.

    Raises:
        ScenarioError: there is none such.
    """

    def own(items: Mapping[str, Any]) -> dict[str, Any]:
        return {
            name.removeprefix(prefix): item
            for name, item in items.items() if name.startswith(prefix)
        }  # fmt: skip

    columns, texts = own(log.columns), own(log.texts)
    if not columns and not texts:
        raise ScenarioError(f"{log.name}: no column begins with {prefix!r}")
    return replace(
        log, columns=columns, texts=texts, units=own(log.units), noise=own(log.noise),
        gaps=own(log.gaps), origins=own(log.origins), exact=own(log.exact),
    )  # fmt: skip


def _wanted(value: float, wish: Any) -> bool:
    if wish in ("even", "odd"):
        return bool((round(value) % 2 == 1) == (wish == "odd"))
    wishes: list[float] = wish if isinstance(wish, list) else [wish]
    return bool(value in wishes)


def _accepted(log: Log, values: Mapping[str, float]) -> bool:
    wishes: Mapping[str, Any] = log.values.get("where", {})
    for column, wish in wishes.items():
        if column not in values:
            raise ScenarioError(
                f"{log.name}: where names {column!r}, which has no single value for a run"
            )
        if not _wanted(values[column], wish):
            return False
    return True


def _rows(log: Log) -> Iterator[tuple[int, Log]]:
    """Each row of the log's tables; columns with a value per row become values of the run."""
    tables: dict[str, list[tuple[int, Vector]]] = {}
    for name, values in log.columns.items():
        match = _ROW.fullmatch(name)
        if match is not None:
            tables.setdefault(match["stem"], []).append((int(match["index"]), values))
    if "interval" not in log.values:
        raise ScenarioError(f"{log.name}: rows need the interval of their samples [s]")
    stacked = {stem: np.stack([v for _, v in sorted(parts, key=lambda part: part[0])], axis=1)
               for stem, parts in tables.items()}  # fmt: skip
    if not stacked:
        raise ScenarioError(f"{log.name}: has no table of which a row could be a run")
    count, length = next(iter(stacked.values())).shape
    single = {name: values for name, values in log.columns.items()
              if values.shape == (count,) and _ROW.fullmatch(name) is None}  # fmt: skip
    time = np.arange(length) * float(log.values["interval"])
    units = {stem: _unit(log, stem, [i for i, _ in parts]) for stem, parts in tables.items()}
    noise = {
        stem: log.noise[f"{stem}_{parts[0][0]}"]
        for stem, parts in tables.items()
        if f"{stem}_{parts[0][0]}" in log.noise
    }
    units["time"] = "s"
    log = replace(log, units={**log.units, **units}, noise={**log.noise, **noise})
    for row in range(count):
        own = {name: float(column[row]) for name, column in single.items()}
        if _accepted(log, own):
            columns = {stem: np.asarray(table[row]) for stem, table in stacked.items()}
            columns["time"] = time
            yield row, replace(log, name=f"{log.name} {row}", columns=columns,
                               values={**log.values, **own})  # fmt: skip


def _unit(log: Log, stem: str, numbers: list[int]) -> str:
    """The unit of a table.

    Raises:
        ScenarioError: its columns have several.
    """
    said = {unit for i in numbers if (unit := log.units.get(f"{stem}_{i}", ""))}
    if len(said) > 1:
        raise ScenarioError(
            f"{log.name}: the columns of table {stem!r} are in {' and '.join(sorted(said))}; give "
            "them one unit"
        )
    return next(iter(said), log.units.get(stem, ""))


def _each(log: Log, key: str) -> Iterator[tuple[float, Log]]:
    """The samples of each value of a column, whole numbers (days, serial numbers) as such."""
    index = log[key]
    for rest in np.unique(index[np.isfinite(index)]).tolist():
        value = int(rest) + log.origins.get(key, 0) if rest.is_integer() else rest
        if _accepted(log, {key: value}):
            mine = index == rest
            columns = {
                name: values[mine]
                for name, values in log.columns.items()
                if values.shape == index.shape
            }
            yield value, replace(log, name=f"{log.name} {value!r}", columns=columns)


def windows(name: str, log: Log, lead: float) -> Iterator[tuple[str, Log]]:
    """The windows of a log, each with its inputs from `lead` before on, at negative times.

    Raises:
        ScenarioError: it is shorter than one.
    """
    if "window" not in log.values:
        yield name, log
        return
    length = float(log.values["window"])
    time = log.time
    edge = ROUNDING * length
    lasts = time[-1] - time[0] + edge
    if lasts < length:
        raise ScenarioError(
            f"{log.name}: run {name!r} lasts {lasts - edge:.6g} s, less than its window of "
            f"{length:g} s; leave it out, or give it another window"
        )
    for k in range(int(lasts / length)):
        begin = time[0] + k * length
        mine = (time >= begin - lead - edge) & (time <= begin + length + edge)
        columns = {one: values[mine] for one, values in log.columns.items()
                   if values.shape == time.shape}  # fmt: skip
        columns["time"] = time[mine] - begin
        own = {one: (times - begin, values) for one, (times, values) in log.own.items()}
        yield f"{name} {k}", replace(log, name=f"{log.name} {k}", columns=columns, own=own)


def relative_pose(pose: Vector, anchor: int) -> Vector:
    """Planar poses (columns x, y, yaw) in the frame of one of them."""
    dx, dy, turn = (pose - pose[anchor]).T
    sine, cosine = np.sin(pose[anchor, 2]), np.cos(pose[anchor, 2])
    return np.column_stack([cosine * dx + sine * dy, cosine * dy - sine * dx, turn])
