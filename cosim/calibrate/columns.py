"""The columns that a mapping makes of a log's: units, signs, clocks, gaps, filters."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, filtfilt

from ..data.logs import Log
from ..errors import ScenarioError, listing
from .parts import COINCIDENT

Vector = NDArray[np.float64]
GAP = 3.0
"""Intervals of a clock longer than this many usual ones are gaps."""
KEYS = {"source", "time", "late", "scale", "offset", "unit", "lowpass", "derivative", "hold", "gap",
        "limit", "ends", "unwrap", "quaternion"}  # fmt: skip
ITEM = re.compile(r"(?P<key>\w+)(?:\[(?P<index>\d+)\])?$")
_RANGE = re.compile(r"(?P<stem>.*?)(?P<first>\d+)\.\.(?P<last>\d+)(?P<tail>.*)$")


def expand(name: str) -> list[str]:
    """Column names behind a sheet's `q_1..6` or `m1..5_x` (others stand for themselves)."""
    match = _RANGE.fullmatch(name)
    if match is None:
        return [name]
    numbers = range(int(match["first"]), int(match["last"]) + 1)
    return [f"{match['stem']}{i}{match['tail']}" for i in numbers]


def prepared(log: Log, table: Mapping[str, Any], path: Path) -> Log:
    """The log on one clock, with the columns that a mapping makes.

    Args:
        log: as read.
        table: the mapping.
        path: of the mapping, for texts.

    Raises:
        ScenarioError, UnknownNameError: an entry is wrong or does not fit the log.
    """
    entries = table.get("columns", {})
    main = str(table.get("time", "time"))
    if not entries and main == "time" and "resample" not in table:
        return log
    clock = log[main]
    time = clock
    if "resample" in table:
        interval = float(table["resample"])
        time = clock[0] + interval * np.arange(
            int((clock[-1] - clock[0]) / interval + COINCIDENT) + 1
        )
    columns: dict[str, Vector] = {
        name: values for name, values in log.columns.items() if values.shape == time.shape
    }
    if "resample" in table:
        columns = {"time": time}
    units = dict(log.units)
    for pattern, entry in entries.items():
        for i, name in enumerate(expand(pattern), 1):
            where = f"{path}: column {name}"
            unknown = set(entry) - KEYS
            if unknown:
                raise ScenarioError(
                    f"{where}: has no key {sorted(unknown)[0]!r}; {listing(sorted(KEYS))}"
                )
            item = {**entry, "source": str(entry.get("source", name)).replace("{}", str(i))}
            values = _ends(log, item, time, where) if "ends" in entry else _column(
                log, item, main, time, where
            )  # fmt: skip
            values = _filtered(time, values, entry, where)
            columns[name] = values * float(entry.get("scale", 1.0)) + float(
                entry.get("offset", 0.0)
            )
            units[name] = str(entry.get("unit", units.get(name, "")))
    clock = columns.get("time", time)
    first, last = log.values.get("samples", (1, clock.size))
    part = slice(int(first) - 1, int(last))
    columns = {name: values[part] for name, values in columns.items()}
    clock = clock[part]
    if clock.size == 0:
        raise ScenarioError(f"{log.name}: has {time.size} samples, none from {first} to {last}")
    columns["time"] = clock - clock[0]
    return replace(log, columns=columns, units=units)


def _ends(log: Log, entry: Mapping[str, Any], time: Vector, where: str) -> Vector:
    """Two values that are known at the first and the last sample."""
    if len(entry["ends"]) != 2:
        raise ScenarioError(f"{where}: ends takes two values, for the first and the last sample")
    values = np.full(time.shape, np.nan)
    values[[0, -1]] = [_element(log, str(item), where) for item in entry["ends"]]
    if entry.get("unwrap", False):
        period = _period(entry)
        values[-1] -= period * np.rint((values[-1] - values[0]) / period)
    return values


def _period(entry: Mapping[str, Any]) -> float:
    """What a column's values jump by: a whole turn, or the number given."""
    return 2 * np.pi if entry["unwrap"] is True else float(entry["unwrap"])


def _element(log: Log, item: str, where: str) -> float:
    """One value of a column: `name[0]`, or the first one."""
    match = ITEM.fullmatch(item)
    if match is None:
        raise ScenarioError(f"{where}: {item!r} names no value of a column")
    values, index = log[match["key"]], int(match["index"] or 0)
    if index >= values.size:
        raise ScenarioError(f"{where}: {match['key']} has {values.size} values, none at {index}")
    return float(values[index])


def _column(log: Log, entry: Mapping[str, Any], main: str, time: Vector, where: str) -> Vector:
    """A column on the main clock."""
    values = _yaw(log, entry["quaternion"]) if "quaternion" in entry else log[str(entry["source"])]
    name = str(entry.get("time", main))
    own = log[name] - float(entry.get("late", 0.0))
    if own.shape != values.shape:
        raise ScenarioError(
            f"{where}: {values.size} values, but its clock has {own.size} times; name its "
            "own clock with time"
        )
    if "limit" in entry:
        values = np.where(np.abs(values) > float(entry["limit"]), np.nan, values)
    if entry.get("unwrap", False):
        values = values.copy()
        good = np.isfinite(values)
        values[good] = np.unwrap(values[good], period=_period(entry))
    same = name == main and not entry.get("late", 0.0) and time is log[main]
    if same and "gap" not in entry:
        return values
    longest = float(entry["gap"]) if "gap" in entry else None
    return _resampled(time, own, values, longest=longest, hold=bool(entry.get("hold", False)))


def _yaw(log: Log, names: list[str]) -> Vector:
    """Yaw of a quaternion x, y, z, w that turns body into world axes."""
    x, y, z, w = (log[name] for name in names)
    return np.asarray(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y**2 + z**2)))


def _resampled(
    times: Vector, own: Vector, values: Vector, *, longest: float | None, hold: bool
) -> Vector:
    """Values of another clock; NaN outside it and, unless held, where it has gaps.

    Args:
        times: wanted.
        own, values: the column and its clock.
        longest: gap that is bridged, `GAP` usual intervals if not given.
        hold: take the last value before instead of interpolating.
    """
    good = np.isfinite(values) & np.isfinite(own)
    own, values = own[good], values[good]
    if own.size < 2:
        return np.full(times.shape, np.nan)
    if hold:
        place = np.searchsorted(own, times, side="right") - 1
        return np.where(place >= 0, values[np.maximum(place, 0)], np.nan)
    result = np.interp(times, own, values, left=np.nan, right=np.nan)
    place = np.clip(np.searchsorted(own, times), 1, own.size - 1)
    if longest is None:
        longest = GAP * float(np.median(np.diff(own)))
    gap = own[place] - own[place - 1] > longest
    return np.where(gap, np.nan, result)


def _filtered(times: Vector, values: Vector, entry: Mapping[str, Any], where: str) -> Vector:
    """Low-pass without phase (fifth-order Butterworth, forward and back) and derivative."""
    cutoff = float(entry.get("lowpass", 0.0))
    if not cutoff and not entry.get("derivative", False):
        return values
    share = 2.0 * cutoff * float(np.median(np.diff(times)))
    if share >= 1.0:
        raise ScenarioError(f"{where}: a low-pass of {cutoff:g} is above half the sample rate")
    if not np.isfinite(values).all():
        raise ScenarioError(f"{where}: has gaps, which a filter does not bridge")

    def smooth(rough: Vector) -> Vector:
        return filtfilt(*butter(5, share), rough) if share else rough

    values = smooth(values)
    if entry.get("derivative", False):
        values = smooth(np.gradient(values, times))
    return np.asarray(values, dtype=np.float64)
