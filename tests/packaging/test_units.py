"""Declarations are in coherent SI units of the one grammar that cosim has."""

from __future__ import annotations

import pytest

from sources.quantity import Quantity
from sources.units import base_exponents, coherent


def test_a_unit_is_the_powers_of_its_base_units() -> None:
    assert base_exponents(coherent("N.m.s/rad")) == {"kg": 1, "m": 2, "s": -1, "rad": -1}
    assert base_exponents(coherent("V/(A.s)")) == {"kg": 1, "m": 2, "s": -4, "A": -2}
    assert base_exponents(coherent("1")) == {}


@pytest.mark.parametrize(
    ("unit", "message"),
    [
        ("mm", "unit 'mm' is 0.001 m; declarations and device files are in SI units, here 'm'"),
        (
            "degC",
            "unit 'degC' is 1 K from 273.15; declarations and device files are in SI units, "
            "here 'K'",
        ),
        ("", "unit '': a plain number is declared in '1'"),
        ("-", "unit '-': a plain number is declared in '1'"),
    ],
)
def test_a_declaration_is_in_si(unit: str, message: str) -> None:
    with pytest.raises(ValueError) as caught:
        Quantity("x", unit, "anything")
    assert str(caught.value) == message


def test_an_unknown_unit_is_named() -> None:
    with pytest.raises(ValueError, match=r"^unit 'N\.furlong': 'furlong' is not a known unit; "):
        Quantity("x", "N.furlong", "anything")
