"""Units: parsing and conversion."""

from __future__ import annotations

import math

import pytest

from cosim.errors import UnitError
from cosim.spec.units import conversion, parse, per_second


@pytest.mark.parametrize(
    ("source", "target", "value", "expected"),
    [
        ("rpm", "rad/s", 60.0, 2.0 * math.pi),
        ("U/min", "rad/s", 60.0, 2.0 * math.pi),
        ("RPM", "rpm", 60.0, 60.0),
        ("deg", "rad", 180.0, math.pi),
        ("mm", "m", 1.0, 1e-3),
        ("kN", "N", 2.0, 2000.0),
        ("mH", "H", 0.4, 4e-4),
        ("kg.m2/s2", "J", 3.0, 3.0),
        ("V/(A.s)", "ohm/s", 2.0, 2.0),
        ("degC", "K", 20.0, 293.15),
        ("K", "degC", 0.0, -273.15),
        ("km/h", "m/s", 3.6, 1.0),
        ("-", "1", 5.0, 5.0),
        ("%", "1", 5.0, 0.05),
        ("min", "s", 2.0, 120.0),
    ],
)
def test_conversion(source: str, target: str, value: float, expected: float) -> None:
    gain, offset = conversion(parse(source), parse(target))
    assert gain * value + offset == pytest.approx(expected, rel=1e-14)  # a few roundings


def test_equal_units_are_passed_on_exactly() -> None:
    assert conversion(parse("N.m"), parse("J")) == (1.0, 0.0)


def test_incompatible_units_name_both_and_their_dimension() -> None:
    with pytest.raises(
        UnitError, match=r"'N' \(SI kg.m.s-2\) does not convert into 'm/s' \(SI m.s-1\)"
    ):
        conversion(parse("N"), parse("m/s"))
    with pytest.raises(UnitError, match="does not convert"):
        conversion(parse("Hz"), parse("rad/s"))


@pytest.mark.parametrize("symbol", ["furlong", "N..m", "m2x", "degC/s"])
def test_unknown_unit(symbol: str) -> None:
    with pytest.raises(UnitError, match="unit"):
        parse(symbol)


@pytest.mark.parametrize(
    ("symbol", "rate"),
    [
        ("rad", "rad/s"), ("m/s", "m/(s.s)"), ("V/(A.s)", "V/(A.s.s)"), ("1", "1/s"), ("-", "1/s"),
        ("U/min", "rpm/s"), ("degC", "K/s"), ("any", "any"),
    ],
)  # fmt: skip
def test_what_a_unit_is_per_second(symbol: str, rate: str) -> None:
    assert per_second(symbol) == rate
    parse(rate)
