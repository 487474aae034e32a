"""What a factor between two units does: units are converted, not labels.

    result = gain * value + offset

with gain and offset of the two units where both are known. A factor that is given as well comes on
top if it is a sign (1 or -1), and is all there is if it is the conversion itself (to 1 %) or if the
units measure different things (a torque of a current). What could be read either way is refused.
"""

from __future__ import annotations

from functools import lru_cache

from ..errors import UnitError
from ..spec.units import Unit, conversion, parse

SAME = 0.01
"""Share by which a factor may miss a conversion and still be it: written with three digits."""


def per_second(unit: str) -> Unit | None:
    """Unit of the derivative in time; None of an unknown one."""
    if not unit:
        return None
    whole = parse(unit)
    exponents = list(whole.exponents)
    exponents[2] -= 1
    return Unit(f"({unit})/s", tuple(exponents), whole.factor)


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
    if (gain, offset) == (1.0, 0.0) or abs(abs(own) / gain - 1.0) < SAME:
        return own, 0.0
    if abs(own) == 1.0:
        return own * gain, own * offset
    raise UnitError(
        f"{where}: {source.symbol!r} becomes {target.symbol!r} by {gain:.6g}, and {key} = {own:g} "
        f"may hold this factor or not; {way}"
    )
