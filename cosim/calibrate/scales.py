"""What a factor between two units does: units are converted, not labels.

    result = gain * value + offset

with gain and offset of the two units where both are known. A factor that is given as well comes on
top if it is a sign (1 or -1), stands for the conversion if it is that one rounded to its own digits
(and to 1 %), which then is taken exactly, and is all there is if the units measure different things
(a torque of a current). What could be read either way is refused, and so is a conversion that
misses its last digit: 0.0174 is not pi / 180, and a fit believes its third digit.
"""

from __future__ import annotations

import math
from decimal import Decimal
from functools import lru_cache

from ..errors import UnitError
from ..spec.units import Unit, conversion, parse

SAME = 0.01
"""Share by which a factor may miss a conversion and be meant as it: written with two digits."""
DIGITS = 1e-12
"""Share by which two ways to compute a conversion differ, and more."""


@lru_cache(maxsize=None)
def known(unit: str, where: str) -> Unit:
    """A unit.

    Raises:
        UnitError: with where it was given.
    """
    try:
        return parse(unit)
    except UnitError as error:
        raise UnitError(f"{where}: {error}") from None


def scaled(
    source: Unit | None, target: Unit | None, factor: float | None, where: str, key: str, way: str
) -> tuple[float, float]:
    """Gain and offset from one unit to another.

    Args:
        source, target: None where unknown.
        factor: given in the mapping, None if it is not.
        where, key: of the factor, for texts.
        way: what to do where a factor may or may not hold the conversion.

    Raises:
        UnitError: the units do not fit, or the factor may be read in two ways.
    """
    own = 1.0 if factor is None else factor
    if source is None or target is None:
        return own, 0.0
    try:
        gain, offset = conversion(source, target)
    except UnitError as error:
        if factor is not None:
            return own, 0.0
        raise UnitError(
            f"{where}: {error}; name the right unit, or give the factor between them as {key}"
        ) from None
    if (gain, offset) == (1.0, 0.0):
        return own, 0.0
    if abs(own) == 1.0:
        return own * gain, own * offset
    if abs(abs(own) / gain - 1.0) < SAME:
        if abs(abs(own) - gain) <= _half_a_digit(own) + DIGITS * gain:
            return math.copysign(gain, own), 0.0
        raise UnitError(
            f"{where}: {source.symbol!r} becomes {target.symbol!r} by {gain:.17g}, and {key} = "
            f"{own:g} is not that one rounded; leave it out, which converts exactly (-1 turns the "
            "sign), or write the exact one"
        )
    raise UnitError(
        f"{where}: {source.symbol!r} becomes {target.symbol!r} by {gain:.6g}, and {key} = {own:g} "
        f"may hold this factor or not; {way}"
    )


def to_unit(own: str, wanted: str, where: str) -> tuple[float, float]:
    """Gain and offset from one unit to another, of nothing where one of them is not given.

    Raises:
        UnitError: the units do not fit.
    """
    if not own or not wanted:
        return 1.0, 0.0
    return scaled(known(own, where), known(wanted, where), None, where, "unit", "")


def zeroed(offset: float, given: float) -> float:
    """The offset between two units with one that the mapping gives, which may be that one itself.

    A mapping that takes a column from degC to K with offset = 273.15 (or 273) means it once.
    """
    meant = offset and abs(given - offset) <= _half_a_digit(given)
    return offset if meant else offset + given


def _half_a_digit(value: float) -> float:
    """Half of a number's last decimal, as it is written: 0.5e-4 of 0.0175."""
    exponent = Decimal(repr(value)).normalize().as_tuple().exponent
    return 0.5 * 10.0**exponent if isinstance(exponent, int) else 0.0
