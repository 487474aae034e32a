"""Units as SI exponents: the part of unit algebra that FMI's `BaseUnit` can express."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache

BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
"""FMI base units, in the order of the attributes of `BaseUnit`."""

_SYMBOLS: dict[str, tuple[dict[str, int], float]] = {
    "1": ({}, 1.0),
    **{name: ({name: 1}, 1.0) for name in BASE},
    "N": ({"kg": 1, "m": 1, "s": -2}, 1.0),
    "J": ({"kg": 1, "m": 2, "s": -2}, 1.0),
    "W": ({"kg": 1, "m": 2, "s": -3}, 1.0),
    "V": ({"kg": 1, "m": 2, "s": -3, "A": -1}, 1.0),
    "ohm": ({"kg": 1, "m": 2, "s": -3, "A": -2}, 1.0),
    "H": ({"kg": 1, "m": 2, "s": -2, "A": -2}, 1.0),
    "C": ({"A": 1, "s": 1}, 1.0),
    "Hz": ({"s": -1}, 1.0),
    "Pa": ({"kg": 1, "m": -1, "s": -2}, 1.0),
}


@dataclass(frozen=True)
class Unit:
    """A unit `value_SI = factor * value`, with integer exponents of the FMI base units."""

    symbol: str
    exponents: tuple[tuple[str, int], ...]
    factor: float = 1.0


@lru_cache(maxsize=None)
def parse(symbol: str) -> Unit:
    """Parse a unit such as `N.m.s/rad`, `kg.m2` or `V/(A.s)`.

    `.` multiplies, a trailing integer is an exponent, and what follows `/` (one factor, or several
    in brackets) divides.

    Raises:
        ValueError: an unknown symbol, with the known ones.
    """
    total: dict[str, int] = {}
    factor = 1.0
    numerator, _, denominator = symbol.partition("/")
    parts = [(part, 1) for part in numerator.split(".")]
    if denominator:
        parts += [(part, -1) for part in denominator.strip("()").split(".")]
    for part, sign in parts:
        match = re.fullmatch(r"([A-Za-z]+|1)(-?\d+)?", part)
        if match is None or match[1] not in _SYMBOLS:
            known = ", ".join(sorted(_SYMBOLS))
            raise ValueError(f"unit {symbol!r}: {part!r} is not a known unit (known: {known})")
        exponents, scale = _SYMBOLS[match[1]]
        power = sign * int(match[2] or 1)
        factor *= scale**power
        for name, exponent in exponents.items():
            total[name] = total.get(name, 0) + power * exponent
    return Unit(symbol, tuple((name, total[name]) for name in BASE if total.get(name)), factor)
