"""Plain tables: text, Parquet, npz and MATLAB files are a topic each, or one per clock in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...data.logs import Log, read_log
from ..clock import rises
from ..topic import Source, Topic
from ..words import TIME, pieces, words

NAMES = {".csv": "CSV", ".tsv": "text", ".txt": "text", ".parquet": "Parquet", ".npz": "npz",
         ".mat": "MATLAB"}  # fmt: skip


def read(path: Path, topics: tuple[str, ...]) -> Source:
    """Read a table; it is one topic, whatever topics are wanted.

    Several clocks in it that are known in different rows (logs that were merged) are a topic each,
    with the columns that are named as the clock is, or lack the same rows.

    Raises:
        ScenarioError: it is missing, damaged or too large.
    """
    kind = NAMES.get(path.suffix.lower(), "table")
    log = read_log(path)
    shares = _shares(log)
    if len(shares) < 2:
        return Source(path, kind, (Topic(path.stem, kind, log),))
    made = [
        Topic(_name(path, clock), kind, _part(log, clock, names), clock=clock,
              notes=(f"the table has {len(shares)} clocks; these columns are on {clock}",))
        for clock, names in shares.items()
    ]  # fmt: skip
    taken = {name for clock, names in shares.items() for name in (clock, *names)}
    left = {
        name: f"{values.size} values, as many as no clock has"
        for name, values in log.columns.items() if name not in taken
    }  # fmt: skip
    return Source(path, kind, tuple(made), plain=False, left=left)


def _name(path: Path, clock: str) -> str:
    return "_".join(_rest(clock)) or path.stem


def _rest(name: str) -> list[str]:
    """Pieces of a clock's name besides the word for time: `p` of `p_t`, `cmd` of `t_cmd`."""
    return [part for part in pieces(name) if TIME not in words(part)]


def _named_alike(clock: str, column: str) -> bool:
    """Whether a column's name begins or ends as that of a clock does."""
    rest, parts = _rest(clock), pieces(column)
    return bool(rest) and rest in (parts[: len(rest)], parts[-len(rest) :])


def _shares(log: Log) -> dict[str, list[str]]:
    """Columns by clock that has as many values, one entry if there is one clock only."""
    named = [n for n, v in log.columns.items() if TIME in words(n) and rises(v)]
    masks = {name: np.isfinite(values) for name, values in log.columns.items()}
    clocks: list[str] = []
    for name in named:  # of those that are known in the same rows the first one counts
        if not any(_same(masks[name], masks[other]) for other in clocks):
            clocks.append(name)
    if len(clocks) < 2:
        return {}
    shares: dict[str, list[str]] = {clock: [] for clock in clocks}
    for name in log.columns:
        if name in clocks:
            continue
        as_long = [c for c in clocks if log[c].shape == log[name].shape]
        own = [c for c in as_long if _named_alike(c, name)]
        own = own or [c for c in as_long if _same(masks[c], masks[name])] or as_long
        if own:
            shares[own[0]].append(name)
    return {clock: names for clock, names in shares.items() if names}


def _same(one: Any, other: Any) -> bool:
    return bool(one.shape == other.shape and np.array_equal(one, other))


def _part(log: Log, clock: str, names: list[str]) -> Log:
    """Some columns with their clock, in the rows that it has."""
    good = np.isfinite(log[clock])
    kept = [clock, *names]

    def mine(table: Mapping[str, Any]) -> dict[str, Any]:
        return {name: item for name, item in table.items() if name in kept}

    return replace(
        log, columns={name: log[name][good] for name in kept}, units=mine(log.units),
        origins=mine(log.origins), gaps={}, texts={}, exact={},
    )  # fmt: skip
