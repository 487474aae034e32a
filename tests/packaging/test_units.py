"""Declarations are in coherent SI units of the one grammar that cosim has."""

from __future__ import annotations

import pytest

from sources.quantity import Quantity
from sources.units import base_exponents, coherent
from sources.variant import build_model


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


def test_elements_of_a_vector_have_units_of_their_own() -> None:
    units = {v.name: v.quantity.unit for v in build_model("mobile_base/planar").of_role("input")}
    assert [units[f"arm_bias[{k}]"] for k in (1, 3, 4, 6)] == ["N", "N", "N.m", "N.m"]
    # the upper triangle of 6x6: its first row, the corners of the block below, the last element
    assert [units[f"arm_inertia[{k}]"] for k in (1, 4, 12, 15, 16, 21)] == [
        "kg", "kg.m", "kg", "kg.m", "kg.m2", "kg.m2",
    ]  # fmt: skip


@pytest.mark.parametrize(("unit", "units"), [("1", ("N",)), ("N", ("N", "m"))])
def test_elements_need_one_unit_each(unit: str, units: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match=f"'f': {len(units)} units for 2 elements and '{unit}'"):
        Quantity("f", unit, "force and length", size=2, units=units)
