"""What a factor between two known units does: it is the conversion, a sign, or refused."""

from __future__ import annotations

import math

import pytest

from cosim.calibrate.scales import scaled, zeroed
from cosim.errors import UnitError
from cosim.spec.units import parse


def converted(source: str, target: str, factor: float | None) -> tuple[float, float]:
    way = "say from = 'A'"
    return scaled(parse(source), parse(target), factor, "column a", "scale", way)


@pytest.mark.parametrize(
    ("source", "target", "factor", "exact"),
    [
        ("deg", "rad", 0.0175, math.pi / 180),
        ("deg", "rad", -0.01745, -math.pi / 180),
        ("deg", "rad", 0.017453292519943295, math.pi / 180),
        ("rad", "deg", 57.3, 180 / math.pi),
        ("rpm", "rad/s", 0.105, math.pi / 30),
        ("km/h", "m/s", 0.278, 1 / 3.6),
        ("m", "mm", 1000.0, 1000.0),
        ("deg", "rad", -1.0, -math.pi / 180),
        ("deg", "rad", None, math.pi / 180),
    ],
)
def test_a_conversion_that_was_rounded_is_taken_exactly(
    source: str, target: str, factor: float | None, exact: float
) -> None:
    gain, offset = converted(source, target, factor)
    # two roundings of 1e-16 each
    assert (gain, offset) == (pytest.approx(exact, rel=1e-15), 0.0)


@pytest.mark.parametrize(
    ("source", "target", "factor", "exact"),
    [
        ("deg", "rad", 0.0174, "0.01745329251994329"),
        ("deg", "rad", -0.01744, "0.01745329251994329"),
        ("rad", "deg", 57.29, "57.295779513082"),
        ("rpm", "rad/s", 0.10471, "0.104719755119659"),
    ],
)
def test_a_conversion_that_misses_its_last_digit_is_refused(
    source: str, target: str, factor: float, exact: str
) -> None:
    with pytest.raises(UnitError, match="is not that one rounded; leave it out") as error:
        converted(source, target, factor)
    assert exact in str(error.value) and f"scale = {factor:g}" in str(error.value)


def test_a_factor_that_is_no_conversion_is_refused_and_none_is_where_the_units_are_one() -> None:
    with pytest.raises(UnitError, match="may hold this factor or not; say from = 'A'"):
        converted("deg", "rad", 0.5)
    # one digit that happens to be the conversion's first is not the conversion
    with pytest.raises(UnitError, match="may hold this factor or not"):
        converted("deg", "rad", 0.02)
    assert converted("rad", "rad", 0.0174) == (0.0174, 0.0)
    assert converted("A", "N.m", 0.0174) == (0.0174, 0.0)


@pytest.mark.parametrize("factor", [None, 1.0, -1.0])
def test_the_zero_of_a_unit_is_converted_too(factor: float | None) -> None:
    gain, offset = converted("degC", "K", factor)
    assert (gain, offset) == ((-1.0, -273.15) if factor == -1.0 else (1.0, 273.15))


def test_an_offset_that_is_the_unit_s_counts_once() -> None:
    assert zeroed(273.15, 273.15) == zeroed(273.15, 273.0) == zeroed(273.15, 0.0) == 273.15
    # any other is an error of the sensor and comes on top
    assert zeroed(273.15, 2.0) == 275.15
    assert zeroed(0.0, 2.0) == 2.0
