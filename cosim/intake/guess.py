"""Units of columns, from their names and sizes; each guess says why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..calibrate.stamps import FACTORS, since_1970
from ..errors import UnitError
from ..spec.units import parse
from .words import pieces, words

Vector = NDArray[np.float64]
_WORDS = {
    "rpm": "rpm", "rad": "rad", "radian": "rad", "radians": "rad", "deg": "deg", "degree": "deg",
    "degrees": "deg", "rev": "rev", "revs": "rev", "mm": "mm", "cm": "cm", "um": "um", "km": "km",
    "meter": "m", "meters": "m", "metre": "m", "ms": "ms", "msec": "ms", "millis": "ms",
    "us": "us", "usec": "us", "micros": "us", "ns": "ns", "nsec": "ns", "nanos": "ns",
    "nanosec": "ns", "sec": "s", "secs": "s", "seconds": "s", "volt": "V", "volts": "V",
    "mv": "mV", "ma": "mA", "amp": "A", "amps": "A", "ampere": "A", "nm": "N.m", "mnm": "mN.m",
    "kg": "kg", "hz": "Hz", "degc": "degC", "celsius": "degC", "pct": "%", "percent": "%",
    "%": "%", "mps": "m/s", "mps2": "m/s2", "radps": "rad/s", "rads": "rad/s", "degps": "deg/s",
    "dps": "deg/s", "kmh": "km/h", "kph": "km/h", "ohm": "ohm", "watt": "W", "watts": "W",
    "newton": "N", "kn": "kN", "kpa": "kPa", "mbar": "", "rps": "rev/s",
}  # fmt: skip
"""Ends of names that are units, in small letters."""
_LETTERS = {"m": "m", "s": "s", "V": "V", "A": "A", "N": "N", "W": "W", "Nm": "N.m", "C": "degC"}
"""Single letters that are units at the end of a name, as written there."""
_OVER = {"rad": "rad", "deg": "deg", "m": "m", "mm": "mm", "cm": "cm", "km": "km", "rev": "rev"}
"""What stands before `_s`, `_per_s` or `_s2`."""
_UNDER = {"s": "s", "sec": "s", "s2": "s2", "h": "h"}
SLOW = 60.0
"""[s] Interval beyond which what may be a time since 1970 is none, if it is usual in a finer unit:
20 ms of a counter of microseconds are 20 000 s there."""
PERIODS = (1e-4, 2.0)
"""Usual intervals of logs [s], between which that of a clock without a unit should be."""
TURNS = (("rad", 2.0 * np.pi), ("deg", 360.0))
NEAR = 0.2
"""Share of a turn by which a jump may miss it."""
ANGLES = ("yaw", "angle", "ang", "theta", "heading", "hdg", "phi", "psi", "roll", "pitch",
          "bearing", "azimuth", "steering", "orientation")  # fmt: skip
"""Words of angles; others of their meaning (`pos`, `q`) may be of a place, too."""
LARGE = {"voltage": ("V", 1000.0, "mV"), "current": ("A", 500.0, "mA")}
"""Unit of a quantity up to a size, and the unit beyond it."""
POSITION = 200.0
"""[m] Robots seldom go further from where they count; beyond it a position is in mm."""
GRAVITY = (9.0, 10.6)
"""[m/s2] Size of an acceleration at rest, with the errors of cheap sensors."""


@dataclass(frozen=True)
class Guess:
    """A unit.

    Attributes:
        unit: "" where nothing tells it.
        reason: why, or why not.
        sure: whether the log says it, or its name does: else it comes from sizes alone.
    """

    unit: str
    reason: str
    sure: bool = False


def unit_in_name(name: str) -> str:
    """The unit that a name ends with, "" if none."""
    parts = pieces(name)
    if len(parts) < 2 and parts == [name]:
        parts = [name]
    last = parts[-1] if parts else ""
    before = [part for part in parts[:-1] if part.lower() != "per"]
    if last.lower() in _UNDER and before and before[-1].lower() in _OVER and len(before) > 1:
        return f"{_OVER[before[-1].lower()]}/{_UNDER[last.lower()]}"
    if len(parts) < 2:
        # `speedRpm`: at a capital
        split = [word for word in ("Rpm", "RPM", "Deg", "Rad", "Mm", "Ms") if last.endswith(word)]
        return _WORDS[split[0].lower()] if split and last != split[0] else ""
    if last.lower() in _WORDS:
        return _WORDS[last.lower()]
    return _LETTERS.get(last, "")


def turn_of(values: Vector) -> tuple[str, float, int]:
    """Unit of an angle that begins anew at a turn, the turn, and how often; ("", 0, 0) if not.

    It jumps by a turn (to `NEAR`) from one sample to the next, while half of its changes are below
    a hundredth of that (a twentieth, of those that are any: a command may stand and jump), and
    spans no more than a turn.
    """
    good = values[np.isfinite(values)]
    steps = np.abs(np.diff(good))
    if steps.size < 3:
        return "", 0.0, 0
    for unit, turn in TURNS:
        count = int(np.count_nonzero(np.abs(steps / turn - 1.0) < NEAR))
        calm = count and np.median(steps) < 0.01 * turn and np.ptp(good) < 1.05 * turn
        if calm and np.median(steps[steps > 0.0]) < 0.05 * turn:
            return unit, turn, count
    return "", 0.0, 0


def known_unit(text: str) -> bool:
    """Whether a text is a unit."""
    try:
        parse(text)
    except UnitError:
        return False
    return bool(text)


def _is_time(unit: str) -> bool:
    return known_unit(unit) and parse(unit).exponents == parse("s").exponents


def is_angle(unit: str) -> bool:
    """Whether a unit is one of angles; an unknown one may be."""
    try:
        return not unit or parse(unit).exponents == parse("rad").exponents
    except UnitError:
        return False


def guess_unit(name: str, values: Vector, said: str = "") -> Guess:
    """Unit of a column.

    Args:
        name: of the column.
        values: gaps are NaN.
        said: the unit that the log states.
    """
    if said:
        return Guess(said, "stated in the log", sure=True)
    good = values[np.isfinite(values)]
    turned, turn, count = turn_of(values)
    if unit := unit_in_name(name):
        return Guess(unit, "its name ends with it", sure=True)
    if not good.size:
        return Guess("", "it holds no numbers")
    if turned:
        return Guess(turned, f"it jumps by {turn:.4g} {count} times: a turn")
    return _by_size(words(name), {p.lower() for p in pieces(name)}, good)


def _by_size(said: Sequence[str], raw: set[str], good: Vector) -> Guess:
    """Unit by what the words of a name measure, and by size."""
    largest = float(np.max(np.abs(good)))
    size = f"its largest value is {largest:.4g}"
    for word, (usual, limit, beyond) in LARGE.items():
        if word in said:
            return Guess(usual if largest <= limit else beyond, f"a {word}, and {size}")
    if any(word in said for word in ("acceleration", "acc", "accel")):
        rest = float(np.median(np.abs(good)))
        if GRAVITY[0] < rest < GRAVITY[1]:
            return Guess("m/s2", f"an acceleration whose usual size is gravity's ({rest:.4g})")
        return Guess("", "an acceleration: in m/s2 or in units of gravity")
    if "speed" in said:
        return Guess("", f"a speed, and {size}: rad/s, rpm, m/s?")
    turns = any(word in raw for word in ANGLES)
    if said and said[-1] in ("x", "y", "z") and not turns:
        unit = "m" if largest <= POSITION else "mm"
        return Guess(unit, f"a position, and {size}")
    if "angle" in said and not turns:
        return Guess("", f"a position, and {size}: of an angle or of a place?")
    if any(word in said for word in ANGLES):
        if largest <= 1.02 * np.pi:
            return Guess("rad", f"an angle, and {size}: within half a turn in radians")
        if largest > 50.0 and largest <= 362.0:
            return Guess("deg", f"an angle, and {size}")
        return Guess("", f"an angle, and {size}: rad or deg?")
    return Guess("", "neither name nor size tell")


def guess_time(name: str, values: Vector, said: str = "", origin: int = 0) -> Guess:
    """Unit of a clock.

    Args:
        name: of the column.
        values: of it.
        said: the unit that the log states.
        origin: what was taken off all values to keep them exact.
    """
    if said and not _is_time(said):
        return Guess("", f"{said!r}, as the log says, is no unit of time")
    if said:
        return Guess(said, "stated in the log", sure=True)
    good = values[np.isfinite(values)]
    size = abs(float(np.median(good))) + origin if good.size else 0.0
    steps = np.diff(good)
    usual = float(np.median(steps)) if steps.size else 0.0
    epoch, named = since_1970(size), unit_in_name(name)
    by_interval = next(
        (unit for unit, factor in FACTORS.items()
         if PERIODS[0] <= usual * factor <= PERIODS[1]), "")  # fmt: skip
    if epoch and named in ("", epoch):
        finer = by_interval and FACTORS[by_interval] < FACTORS[epoch]
        if usual * FACTORS[epoch] <= SLOW or not finer:
            return Guess(epoch, f"{size:.4g} is a time since 1970", sure=epoch != "s")
    if named:
        return Guess(named, "its name ends with it", sure=True)
    if by_interval:
        interval = usual * FACTORS[by_interval]
        return Guess(by_interval, f"an interval of {usual:.4g} is then {interval:.4g} s")
    return Guess("", f"an interval of {usual:.4g} is of no usual size")
