"""The columns that a mapping makes of a log's: units, signs, clocks, gaps, filters."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data.logs import Log
from ..errors import ScenarioError, UnitError
from ..spec.units import Unit, parse, per_second
from .parts import COINCIDENT
from .scales import known, scaled, zeroed
from .stamps import Clocks, apart, check_rising, check_span, with_times

Vector = NDArray[np.float64]
GAP = 3.0
"""Intervals of a clock longer than this many usual ones are gaps."""
UNIT_LENGTH, SAME_LENGTH = 0.05, 0.01
"""Quaternions may miss the length 1 by the first, and lengths may differ from each other by the
second (a fixed-point format, rounded), and still turn by what they say once normalised."""
TURNS = 1.05
"""An angle in radians that begins anew at a turn spans no more than this many turns."""
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
        UnitError: units that do not fit.
    """
    entries = table.get("columns", {})
    main = str(table.get("time", "time"))
    clocks = Clocks(log, main)
    told = entries.get("time", {})
    told = told if str(told.get("source", "time")) == main and not OTHER & told.keys() else {}
    if told:
        _tell(log, {**told, "source": main}, clocks, f"{path}: column time")
    log, clock = with_times(log, main, clocks(main))
    time = clock
    if "resample" in table:
        interval = float(table["resample"])
        check_rising(log, main, clock, twice=True)
        check_span(log, main, clock)
        time = clock[0] + interval * np.arange(
            int((clock[-1] - clock[0]) / interval + COINCIDENT) + 1
        )
    columns: dict[str, Vector] = {} if "resample" in table else dict(log.columns)
    columns["time"] = time
    own: dict[str, tuple[Vector, Vector]] = {}
    units, noise = dict(log.units), dict(log.noise)
    if told:
        units["time"] = "s"
    for pattern, entry in entries.items():
        for i, name in enumerate(expand(pattern), 1):
            if told and name == "time":
                continue
            where = f"{path}: column {name}"
            item = {**entry, "source": str(entry.get("source", name)).replace("{}", str(i))}
            source, target = _units(log, item, units.get(name, ""), where)
            gain, offset = _scaled(source, target, item, where)
            turn = _turn(item, target, gain, where)
            values = _ends(log, item, time, turn, where) if "ends" in entry else _column(
                log, item, clocks, time, clock, turn, where
            )  # fmt: skip
            values = _filtered(time, values, entry, where)
            offset = zeroed(offset, float(entry.get("offset", 0.0)))
            columns[name] = values * gain + offset
            if (held := _held(item, clocks)) is not None and "resample" not in table:
                own[name] = held[0], held[1] * gain + offset
            units[name] = target.symbol if target else ""
            noise.pop(name, None)
            noise.update(_noise(log, item, name, gain, target, where))
    clock = columns["time"]
    first, last = log.values.get("samples", (1, clock.size))
    part = slice(int(first) - 1, int(last))
    # those of another length are told apart from such as do not exist
    columns = {
        name: values[part] if values.shape == time.shape else values
        for name, values in columns.items()
    }
    clock = clock[part]
    if clock.size == 0:
        raise ScenarioError(f"{log.name}: has {time.size} samples, none from {first} to {last}")
    if entries or main != "time" or main in log.origins or not 0.0 <= clock[0] < LATEST:
        clock = clock - clock[0]
    columns["time"] = clock
    raw = time[part]
    if raw[-1] != raw[0]:  # else it is one sample, or a clock that stands still, which is refused
        rate = (clock[-1] - clock[0]) / (raw[-1] - raw[0])
        own = {one: (clock[0] + rate * (t - raw[0]), v) for one, (t, v) in own.items()}
    return replace(log, columns=columns, units=units, noise=noise, own=own)


def _tell(log: Log, entry: Mapping[str, Any], clocks: Clocks, where: str) -> None:
    """Make the main clock as its entry does, in seconds.

    Raises:
        ScenarioError, UnitError: the entry does not fit, or makes no time.
    """
    source, target = _units(log, entry, "", where)
    if target is not None and target.exponents != parse("s").exponents:
        raise UnitError(f"{where}: is the main clock, and its unit {target.symbol!r} is no time")
    gain, _ = _scaled(source, target, entry, where)
    factor: float | None = gain * (target.factor if target else 1.0)
    if source is None and "scale" not in entry and (clocks.factor is not None or target is None):
        factor = clocks.factor  # the entry names a unit at most, and the clock's own is known
    turn = _turn(entry, target, gain, where)
    raw = log[clocks.main]
    clocks.tell(_column(log, entry, clocks, raw, raw, turn, where), factor)


OTHER = {"time", "late", "ends", "quaternion", "lowpass", "derivative"}
"""Keys of a column that is no main clock: it is made of another one, or filtered."""


def _scaled(
    source: Unit | None, target: Unit | None, entry: Mapping[str, Any], where: str
) -> tuple[float, float]:
    """Gain and offset that make a column of its source."""
    return scaled(
        source, target, entry.get("scale"), where, "scale",
        f"say from = {source.symbol if source else ''!r} if it does not, or "
        f"from = {target.symbol if target else ''!r} if it does",
    )  # fmt: skip


def _noise(
    log: Log, entry: Mapping[str, Any], name: str, gain: float, target: Unit | None, where: str
) -> dict[str, float]:
    """What the sheet says about the noise of a column that is made, in its unit; or nothing.

    Raises:
        UnitError: the sheet tells of what is made, in a unit that does not fit.
    """
    if name in log.noise and name not in log.columns:
        own = known(unit, where) if (unit := log.units.get(name, "")) else None
        gain, _ = scaled(own, target, None, f"{where}: as the sheet has it", "scale", "")
        return {name: abs(gain) * log.noise[name]}
    stated = log.noise.get(str(entry["source"]))
    if stated is None or MADE & {key for key, value in entry.items() if value}:
        return {}
    return {name: abs(gain) * stated}


MADE = {"ends", "quaternion", "derivative"}
"""Keys of a column whose noise is not its source's in another unit."""


def _held(entry: Mapping[str, Any], clocks: Clocks) -> tuple[Vector, Vector] | None:
    """Times and values of a column that is held on a clock of its own; None of any other."""
    if not entry.get("hold") or MAKING & entry.keys():
        return None
    source = str(entry["source"])
    name = str(entry.get("time", clocks.own(source)))
    if name == clocks.main:
        return None
    values, times = clocks.log[source], clocks(name) - float(entry.get("late", 0.0))
    good = np.isfinite(values) & np.isfinite(times)
    return times[good], values[good]


MAKING = {
    "unwrap", "limit", "despike", "fresh", "gap", "ends", "quaternion", "lowpass", "derivative",
    "missing",
}  # fmt: skip
"""Keys with which something else is made of a column than its values at other times."""
LATEST = 1e6
"""[s] A log that begins later than this, or before 0, counts from its own beginning: a master that
counts steps from there would lose digits, and rows before 0 would be lost."""


def _units(
    log: Log, entry: Mapping[str, Any], own: str, where: str
) -> tuple[Unit | None, Unit | None]:
    """Units of what a column is made from, and of what it becomes."""
    said = str(entry.get("from", "")) or (
        "rad" if "quaternion" in entry else log.units.get(_first(entry), "")
    )
    target = str(entry.get("unit", ""))
    if not target:
        plain = float(entry.get("scale", 1.0)) in (1.0, -1.0) and not entry.get("derivative")
        target = (said or own) if plain else ""
    source = known(said, where) if said and target else None
    if source is not None and entry.get("derivative", False):
        source = parse(per_second(said)) if said else None
    return source, known(target, where) if target else None


def _first(entry: Mapping[str, Any]) -> str:
    """The column whose unit counts."""
    return str(entry["ends"][0]).partition("[")[0] if "ends" in entry else str(entry["source"])


def _turn(entry: Mapping[str, Any], target: Unit | None, gain: float, where: str) -> float:
    """What a column's source jumps by when it begins anew: a whole turn, or the number given."""
    said = entry.get("unwrap", False)
    if said is not True:
        return float(said)
    turn = 2 * np.pi
    if target is not None:
        if target.exponents != parse("rad").exponents:
            raise UnitError(
                f"{where}: unwrap = true takes an angle, and its unit is {target.symbol!r}; give "
                "the number at which it begins anew"
            )
        turn = 2 * np.pi / target.factor
    return turn / abs(gain)


def _ends(log: Log, entry: Mapping[str, Any], time: Vector, turn: float, where: str) -> Vector:
    """Two values that are known at the first and the last sample."""
    values = np.full(time.shape, np.nan)
    values[[0, -1]] = [_element(log, str(item), where) for item in entry["ends"]]
    if turn:
        values[-1] -= turn * np.rint((values[-1] - values[0]) / turn)
    return values


def _element(log: Log, item: str, where: str) -> float:
    """One value of a column: `name[0]`, or the first one."""
    match = ITEM.fullmatch(item)
    if match is None:
        raise ScenarioError(f"{where}: {item!r} names no value of a column")
    values, index = log[match["key"]], int(match["index"] or 0)
    if index >= values.size:
        raise ScenarioError(f"{where}: {match['key']} has {values.size} values, none at {index}")
    return float(values[index])


def _column(
    log: Log,
    entry: Mapping[str, Any],
    clocks: Clocks,
    time: Vector,
    clock: Vector,
    turn: float,
    where: str,
) -> Vector:
    """A column on the main clock."""
    source = str(entry["quaternion"][0] if "quaternion" in entry else entry["source"])
    name = str(entry.get("time", clocks.own(source)))
    own = clock if name == clocks.main else clocks(name)
    log = log if name == clocks.main else clocks.log  # its rows need no time of the main clock
    values = _yaw(log, entry["quaternion"], where) if "quaternion" in entry else log[source]
    if own.shape != values.shape:
        raise ScenarioError(f"{where}: " + apart(log, source, name, own.size))
    if name != clocks.main:
        check_rising(log, name, own, twice=True)
    own = own - float(entry.get("late", 0.0))
    if "missing" in entry:
        values = np.where(values == float(entry["missing"]), np.nan, values)
    if "limit" in entry:
        values = np.where(np.abs(values) > float(entry["limit"]), np.nan, values)
    if entry.get("despike", False):
        values = np.where(spikes(values), np.nan, values)
    if entry.get("fresh", False):
        values = np.where(np.append(False, np.diff(values) == 0.0), np.nan, values)
    if turn:
        good = np.isfinite(values)
        spanned = float(np.ptp(values[good])) if good.any() else 0.0
        if entry["unwrap"] is True and spanned > TURNS * turn and _wraps(values[good], turn):
            raise ScenarioError(
                f"{where}: unwrap = true takes a turn of {turn:.6g}, but its values span "
                f"{spanned:.6g}; say its unit (from = 'deg'), or the number at which it begins anew"
            )
        if entry["unwrap"] is not True:
            _check_count(values[good], spanned, turn, where)
        values = values.copy()
        values[good] = np.unwrap(values[good], period=turn)
    same = name == clocks.main and not entry.get("late", 0.0) and time is clock
    if same and "gap" not in entry:
        return values
    longest = float(entry["gap"]) if "gap" in entry else None
    return _resampled(time, own, values, longest=longest, hold=bool(entry.get("hold", False)))


def _check_count(values: Vector, spanned: float, turn: float, where: str) -> None:
    """Refuse a number at which a column cannot begin anew.

    Values that it begins anew at are not farther apart; a count of n bits that shows both 0 and
    2^n - 1 begins anew at 2^n.
    """
    bits = np.log2(turn + 1.0)
    count = spanned == turn and bits == np.rint(bits) and bool(np.all(values == np.rint(values)))
    if count or spanned > TURNS * turn:
        more = f"; counts from {values.min():g} to {values.max():g} begin anew at {turn + 1.0:g}"
        raise ScenarioError(
            f"{where}: unwrap = {turn:g} is said to be where it begins anew, but its values span "
            f"{spanned:.6g}{more * count}"
        )


def _wraps(values: Vector, turn: float) -> bool:
    """Whether values jump by more than a turn: they begin anew somewhere else."""
    steps = np.abs(np.diff(values))
    return bool(steps.size and np.max(steps) > TURNS * turn)


def spikes(values: Vector, noise: float = 0.0) -> NDArray[np.bool_]:
    """Single samples that stand out from both neighbours, which agree with each other.

    A sample x_k is one if it lies on the same side of both neighbours by more than `SPIKE` times
    the usual size s of

        d_k = x_k - (x_k-1 + x_k+1) / 2,    s = median |d_k| / 0.6745

    (and of sqrt(3/2) times the noise), if the neighbours differ by less than a quarter of that, and
    if neither of them stands out from its own by half as much: samples that go up and down in turn
    are a vibration near half the sampling rate. Of white Gaussian noise, d has the deviation s, so
    that one sample in 1e9 (SPIKE = 6) passes the first test; steps and ramps do not, whose
    neighbours differ.
    """
    found = np.zeros(values.shape, dtype=bool)
    good = np.flatnonzero(np.isfinite(values))
    if good.size < 3:
        return found
    x = values[good]
    before, after = x[1:-1] - x[:-2], x[1:-1] - x[2:]
    bend = 0.5 * (before + after)
    size = max(float(np.median(np.abs(bend))) / 0.6745, noise * np.sqrt(1.5))
    least = np.minimum(np.abs(before), np.abs(after))
    stands = (before * after > 0.0) & (least > SPIKE * size)
    out = stands & (np.abs(after - before) < 0.25 * least)
    swing = np.where(stands, least, 0.0)
    out[1:] &= swing[:-1] < 0.5 * least[1:]
    out[:-1] &= swing[1:] < 0.5 * least[:-1]
    found[good[1:-1][out]] = True
    return found


SPIKE = 6.0


def _yaw(log: Log, names: list[str], where: str) -> Vector:
    """Yaw of a quaternion x, y, z, w that turns body into world axes, normalised.

    Raises:
        ScenarioError: lengths that are neither 1 nor all the same.
    """
    parts = np.stack([log[name] for name in names])
    length = np.sqrt(np.sum(parts**2, axis=0))
    good = np.isfinite(length) & (length > 0.0)
    if good.any():
        low, usual, high = (float(f(length[good])) for f in (np.min, np.median, np.max))
        alike = high - low < SAME_LENGTH * usual
        if not alike and max(high - 1.0, 1.0 - low) > UNIT_LENGTH:
            raise ScenarioError(
                f"{where}: {log.name} has quaternions of lengths {low:.4g} to {high:.4g}; they "
                "must be 1, or all the same: name the columns in the order x, y, z, w, or mend "
                "the log"
            )
    return yaw_of(parts)


def yaw_of(parts: Vector) -> Vector:
    """Yaw of quaternions (x, y, z, w) of any length; nan where all are 0: nothing was measured."""
    length = np.sqrt(np.sum(parts**2, axis=0))
    x, y, z, w = parts / np.where(length > 0.0, length, np.nan)
    return np.asarray(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y**2 + z**2)))


def _resampled(
    times: Vector, own: Vector, values: Vector, *, longest: float | None, hold: bool
) -> Vector:
    """Values of another clock; NaN outside it and within its gaps.

    Args:
        times: wanted.
        own, values: the column and its clock.
        longest: gap that is bridged; `GAP` usual intervals if not given, and any if values are
            held, as commands that are sent when they change.
        hold: take the last value before instead of interpolating.
    """
    good = np.isfinite(values) & np.isfinite(own)
    own, values = own[good], values[good]
    if own.size < 2:
        return np.full(times.shape, np.nan)
    if hold:
        # a sample that comes after the main clock's by rounding belongs to it
        clock = COINCIDENT * float(np.median(np.diff(own)))
        place = np.searchsorted(own, times + clock, side="right") - 1
        held = np.where(place >= 0, values[np.maximum(place, 0)], np.nan)
        if longest is None:
            return held
        return np.where(times - own[np.maximum(place, 0)] > longest, np.nan, held)
    result = np.interp(times, own, values, left=np.nan, right=np.nan)
    place = np.clip(np.searchsorted(own, times), 1, own.size - 1)
    usual = float(np.median(np.diff(own)))
    gap = own[place] - own[place - 1] > (GAP * usual if longest is None else longest)
    lost = gap | np.isnan(result)
    nearest = place - (times - own[place - 1] < own[place] - times)
    measured = np.abs(own[nearest] - times) <= COINCIDENT * usual
    return np.where(lost, np.where(measured, values[nearest], np.nan), result)


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

    from scipy.signal import butter, filtfilt  # takes most of a second, and few columns want it

    def smooth(rough: Vector) -> Vector:
        return filtfilt(*butter(5, share), rough) if share else rough

    values = smooth(values)
    if entry.get("derivative", False):
        values = smooth(np.gradient(values, times))
    return np.asarray(values, dtype=np.float64)
