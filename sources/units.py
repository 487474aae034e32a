"""Units of declarations: coherent SI, so that no equation needs a factor."""

from __future__ import annotations

from functools import lru_cache

from cosim.errors import UnitError
from cosim.spec.units import BASE, Unit, parse


@lru_cache(maxsize=None)
def coherent(symbol: str) -> Unit:
    """A unit without factor and offset, such as `N.m.s/rad`; the grammar is `cosim.spec.units`.

    Raises:
        ValueError: an unknown unit, none at all, or one with a factor or an offset.
    """
    try:
        unit = parse(symbol)
    except UnitError as error:
        raise ValueError(str(error)) from error
    if symbol in ("", "-"):
        raise ValueError(f"unit {symbol!r}: a plain number is declared in '1'")
    if (unit.factor, unit.offset) != (1.0, 0.0):
        raise ValueError(
            f"unit {symbol!r} is {unit.factor:g} {unit.dimension()}"
            + (f" from {unit.offset:g}" if unit.offset else "")
            + f"; declarations and device files are in SI units, here {unit.dimension()!r}"
        )
    return unit


def base_exponents(unit: Unit) -> dict[str, int]:
    """The exponents that are not 0, by base unit, as FMI's `BaseUnit` lists them."""
    return {name: power for name, power in zip(BASE, unit.exponents, strict=True) if power}
