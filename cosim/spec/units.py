"""Units as SI exponents with factor and offset, as FMI's `BaseUnit` has them."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import lru_cache

from ..errors import UnitError

BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
"""FMI base units, in the order of the attributes of `BaseUnit`."""

Exponents = tuple[int, ...]


@dataclass(frozen=True)
class Unit:
    """A unit: `value_SI = factor * value + offset`.

    Attributes:
        symbol: as written by its owner.
        exponents: of the base units, in the order of `BASE`.
        factor, offset: conversion to SI.
    """

    symbol: str
    exponents: Exponents
    factor: float = 1.0
    offset: float = 0.0

    def dimension(self) -> str:
        """The SI base units, e.g. `kg.m2.s-2`."""
        parts = [
            name + (str(power) if power != 1 else "")
            for name, power in zip(BASE, self.exponents, strict=True)
            if power
        ]
        return ".".join(parts) or "1"


def _powers(**exponents: int) -> Exponents:
    return tuple(exponents.get(name, 0) for name in BASE)


_ZERO = _powers()
ANY = "any"
"""Unit of what adapters pass on, whatever it is."""
_SYMBOLS: dict[str, tuple[Exponents, float, float]] = {
    "1": (_ZERO, 1.0, 0.0),
    ANY: (_ZERO, 1.0, 0.0),
    "%": (_ZERO, 0.01, 0.0),
    **{name: (_powers(**{name: 1}), 1.0, 0.0) for name in BASE},
    "N": (_powers(kg=1, m=1, s=-2), 1.0, 0.0),
    "J": (_powers(kg=1, m=2, s=-2), 1.0, 0.0),
    "W": (_powers(kg=1, m=2, s=-3), 1.0, 0.0),
    "V": (_powers(kg=1, m=2, s=-3, A=-1), 1.0, 0.0),
    "ohm": (_powers(kg=1, m=2, s=-3, A=-2), 1.0, 0.0),
    "H": (_powers(kg=1, m=2, s=-2, A=-2), 1.0, 0.0),
    "F": (_powers(kg=-1, m=-2, s=4, A=2), 1.0, 0.0),
    "C": (_powers(A=1, s=1), 1.0, 0.0),
    "T": (_powers(kg=1, s=-2, A=-1), 1.0, 0.0),
    "Hz": (_powers(s=-1), 1.0, 0.0),
    "Pa": (_powers(kg=1, m=-1, s=-2), 1.0, 0.0),
    "g": (_powers(kg=1), 1e-3, 0.0),
    "t": (_powers(kg=1), 1e3, 0.0),
    "min": (_powers(s=1), 60.0, 0.0),
    "h": (_powers(s=1), 3600.0, 0.0),
    "deg": (_powers(rad=1), math.pi / 180.0, 0.0),
    "rev": (_powers(rad=1), 2.0 * math.pi, 0.0),
    "rpm": (_powers(rad=1, s=-1), math.pi / 30.0, 0.0),
    "degC": (_powers(K=1), 1.0, 273.15),
}
_ALIASES = dict.fromkeys(("RPM", "U/min", "Upm", "UPM", "r/min"), "rpm")
"""Other ways to write a unit that logs have in their heads."""
_PREFIXES = {"n": 1e-9, "u": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3, "M": 1e6}
_PREFIXED = ("m", "s", "A", "N", "J", "W", "V", "ohm", "H", "F", "C", "T", "Hz", "Pa", "g", "rad")
_HIGHEST = 20
"""Power of a unit; FMI's own exponents stay below ten in all libraries known to us."""
_FACTOR = re.compile(r"([A-Za-z%]+|1)(-?\d+)?")


def _symbol(name: str) -> tuple[Exponents, float, float] | None:
    if name in _SYMBOLS:
        return _SYMBOLS[name]
    if name[:1] in _PREFIXES and name[1:] in _PREFIXED:
        exponents, factor, _ = _SYMBOLS[name[1:]]
        return exponents, factor * _PREFIXES[name[0]], 0.0
    return None


@lru_cache(maxsize=None)
def parse(symbol: str) -> Unit:
    """Parse a unit such as `N.m.s/rad`, `kg.m2`, `V/(A.s)`, `rpm`, `mm`; `-` and `` mean `1`.

    `.` or `*` multiplies, a trailing integer is an exponent, and what follows `/` (one factor, or
    several in brackets) divides.

    Raises:
        UnitError: an unknown symbol.
    """
    text = _ALIASES.get(symbol.strip(), symbol.strip()).replace("*", ".").replace("^", "")
    if text in ("", "-"):
        text = "1"
    total = [0] * len(BASE)
    factor, offset = 1.0, 0.0
    numerator, _, denominator = text.partition("/")
    parts = [(part, 1) for part in numerator.strip("()").split(".")]
    if denominator:
        parts += [(part, -1) for part in denominator.strip("()").split(".")]
    for part, sign in parts:
        match = _FACTOR.fullmatch(part)
        known = _symbol(match[1]) if match else None
        if match is None or known is None:
            raise UnitError(
                f"unit {symbol!r}: {part!r} is not a known unit; write products and powers of "
                f"{', '.join(sorted(_SYMBOLS))} (with a prefix where usual), e.g. 'N.m.s/rad'"
            )
        power = sign * int(match[2] or 1)
        if abs(power) > _HIGHEST:
            raise UnitError(f"unit {symbol!r}: a power of {power} is no physical quantity")
        factor *= known[1] ** power
        if known[2]:
            if len(parts) > 1 or power != 1:
                raise UnitError(f"unit {symbol!r}: {part!r} has an offset and cannot be a factor")
            offset = known[2]
        for index, exponent in enumerate(known[0]):
            total[index] += power * exponent
    return Unit(symbol, tuple(total), factor, offset)


def per_second(symbol: str) -> str:
    """The unit of what a quantity of this unit gains per time; of `any`, `any`.

    Raises:
        UnitError: an unknown symbol.
    """
    unit, text = parse(symbol), _ALIASES.get(symbol.strip(), symbol.strip())
    if text == ANY:
        return ANY
    if text in ("", "-") or unit.offset:  # degrees Celsius change by kelvins
        text = unit.dimension()
    above, _, below = text.partition("/")
    return f"{above}/({below.strip('()')}.s)" if below else f"{above}/s"


def conversion(source: Unit, target: Unit) -> tuple[float, float]:
    """Gain and offset of `target_value = gain * source_value + offset`; 1 and 0 to or from `any`.

    Raises:
        UnitError: the two measure different things.
    """
    if ANY in (source.symbol, target.symbol):
        return 1.0, 0.0
    if source.exponents != target.exponents:
        raise UnitError(
            f"{source.symbol!r} (SI {source.dimension()}) does not convert into "
            f"{target.symbol!r} (SI {target.dimension()})"
        )
    if (source.factor, source.offset) == (target.factor, target.offset):
        return 1.0, 0.0
    return source.factor / target.factor, (source.offset - target.offset) / target.factor


def usual(unit: Unit) -> bool:
    """Whether a unit is what its name means here."""
    try:
        return parse(unit.symbol) == unit
    except UnitError:
        return False


def change(
    symbol: str, own: Unit, *, back: bool = False, difference: bool = False
) -> tuple[float, float]:
    """Gain and offset from a unit, given by its name, into one that somebody defines.

    The owner's name for the unit means what he defines, whatever it means elsewhere.

    Args:
        symbol: of the unit.
        own: the other one.
        back: from `own` into the named one instead.
        difference: of differences, which have no offset.

    Raises:
        UnitError: an unknown name, or the two measure different things.
    """
    named = own if symbol == own.symbol else parse(symbol)
    try:
        gain, offset = conversion(own, named) if back else conversion(named, own)
    except UnitError as error:
        raise UnitError(f"unit {error}") from None
    return gain, 0.0 if difference else offset
