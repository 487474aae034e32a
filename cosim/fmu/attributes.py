"""What attributes of FMI's elements mean: numbers, start values, units, types."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any, TypeVar

from ..data.text import spelled
from ..errors import UnknownNameError, listing
from ..reading.schema import shown
from ..spec.units import BASE, Unit, parse

Scalar = TypeVar("Scalar")
Start = float | bool | str | bytes | None
INTEGERS = (
    "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64", "Enumeration",
    "Enumeration2",
)  # fmt: skip
_DEFAULT_INITIAL = {
    "constant": {"output": "exact", "local": "exact"},
    "fixed": {"structuralParameter": "exact", "parameter": "exact",
              "calculatedParameter": "calculated", "local": "calculated"},
    "tunable": {"structuralParameter": "exact", "parameter": "exact",
                "calculatedParameter": "calculated", "local": "calculated"},
    "discrete": {"input": "exact", "output": "calculated", "local": "calculated"},
    "continuous": {"input": "exact", "output": "calculated", "local": "calculated",
                   "independent": ""},
}  # fmt: skip
"""Initial by variability and causality where it is not given; both tables of FMI agree."""
VARIABILITIES = tuple(_DEFAULT_INITIAL)
INITIALS = ("exact", "approx", "calculated")


class Unsound(ValueError):
    """A description that cannot be used; the text says why and the way out."""


def named(element: ET.Element) -> str:
    """An element in an error text."""
    tag, name = element.tag.rpartition("}")[2], element.get("name")
    return f"<{tag}>" if name is None else f"<{tag}> {shown(name)}"


def needed(element: ET.Element, key: str) -> str:
    """An attribute that must be there.

    Raises:
        Unsound: it is not.
    """
    text = element.get(key)
    if text is None:
        raise Unsound(f"{named(element)} has no {key}")
    return text


def one_of(element: ET.Element, key: str, words: Iterable[str], default: str) -> str:
    """An attribute that is one of some words, spelled like them.

    Raises:
        Unsound: it is another.
    """
    text = element.get(key, default)
    if text not in words and text != default:
        raise Unsound(f"{named(element)} has {key} {shown(text)}; {listing(words, text)}")
    return text


def integer_of(element: ET.Element, key: str) -> int:
    """An attribute that must be a whole number.

    Raises:
        Unsound: it is missing, or none.
    """
    return _read(element, key, needed(element, key), _whole_of)


def wholes_of(element: ET.Element, key: str) -> list[int]:
    """An attribute that is a list of whole numbers, empty where it is not given.

    Raises:
        Unsound: one is none.
    """
    return [_read(element, key, item, _whole_of) for item in element.get(key, "").split()]


def number_of(element: ET.Element, key: str) -> float | None:
    """A floating-point attribute, None where it is not given.

    Raises:
        Unsound: it is no number.
    """
    text = element.get(key)
    return None if text is None else _read(element, key, text, _float_of)


def _read(element: ET.Element, key: str, text: str, reader: Callable[[str], Scalar]) -> Scalar:
    try:
        return reader(text)
    except ValueError as error:
        raise Unsound(f"{named(element)} has {key} = {shown(text)}, {error}") from None


def _whole_of(text: str) -> int:
    """A whole number as XML writes it."""
    try:
        return int("" if "_" in text else text)  # Python takes 1_000 for a number
    except ValueError:
        raise ValueError("which is no whole number") from None


def _float_of(text: str) -> float:
    """A number as XML writes it."""
    try:
        return float("" if "_" in text else text)
    except ValueError:
        raise ValueError("which is no number") from None


def _truth_of(text: str) -> bool:
    if text not in ("true", "1", "false", "0"):
        raise ValueError("which is neither true nor false")
    return text in ("true", "1")


def _bytes_of(text: str) -> bytes:
    try:
        return bytes.fromhex(text)
    except ValueError:
        raise ValueError("which are no hexadecimal digits") from None


def read_units(elements: Iterable[ET.Element], namespace: str = "") -> dict[str, Unit]:
    """Units by name, from elements `Unit` of FMI (or of SSP, which has them in a namespace)."""
    units = {}
    for element in elements:
        base = element.find(f"{namespace}BaseUnit")
        name = element.get("name", "")
        if base is not None:
            factor, offset = number_of(base, "factor"), number_of(base, "offset")
            factor, offset = 1.0 if factor is None else factor, offset or 0.0
            if not (math.isfinite(factor) and factor and math.isfinite(offset)):
                raise Unsound(f"unit {name!r} has factor {factor} and offset {offset}")
            exponents = tuple(integer_of(base, key) if key in base.attrib else 0 for key in BASE)
            units[name] = Unit(name, exponents, factor, offset)
    return units


def counted(where: str, name: str, variables: Mapping[str, Scalar]) -> list[Scalar]:
    """Scalars that count up from `name[0]` or `name[1]`; none where there are none.

    Raises:
        UnknownNameError: one of them is missing: a value for all would set some.
    """
    numbers = sorted(
        int(index) for one in variables
        if one.startswith(f"{name}[") and one.endswith("]")
        and (index := one[len(name) + 1 : -1]).isdecimal()
    )  # fmt: skip
    if not numbers:
        return []
    gap = sorted({*range(min(numbers[0], 1), numbers[-1])} - {*numbers})
    if gap:
        raise UnknownNameError(
            f"{where}: {name!r} is no vector, since it has {name}[{numbers[0]}] to "
            f"{name}[{numbers[-1]}] and no {name}[{gap[0]}]; name the elements one by one"
        )
    return [variables[f"{name}[{number}]"] for number in numbers]


def initial_of(given: str | None, causality: str, variability: str) -> str:
    """`initial` with FMI's default filled in; "" where there is none."""
    return given or _DEFAULT_INITIAL.get(variability, {}).get(causality, "")


def start_of(element: ET.Element, type_: str, key: str = "start") -> tuple[Start, ...]:
    """Start values as one attribute has them, () where it is not given.

    Raises:
        Unsound: they are of another type.
    """
    text = element.get(key)
    if text is None:
        return ()
    if type_ == "String":
        return (text,)
    if type_ == "Binary":
        return (_read(element, key, text, _bytes_of),)
    reader: Callable[[str], Any] = _float_of
    if type_.startswith("Boolean"):
        reader = _truth_of
    elif type_ in INTEGERS:
        reader = _whole_of
    return tuple(_read(element, key, item, reader) for item in text.split())


class Types:
    """Attributes that a variable inherits from the type it declares."""

    def __init__(self, elements: Iterable[ET.Element]) -> None:
        self._types = dict(_named(elements))

    def get(self, element: ET.Element, key: str) -> str | None:
        """An attribute, the element's own or that of its type."""
        value = element.get(key)
        if value is None:
            declared = self._types.get(element.get("declaredType", ""))
            value = declared.get(key) if declared is not None else None
        return value

    def number(self, element: ET.Element, key: str) -> float | None:
        """The same of a floating-point attribute."""
        text = self.get(element, key)
        return None if text is None else _read(element, key, text, _float_of)

    def items(self, element: ET.Element) -> dict[int, str]:
        """Names of the values of an enumeration; FMI 2 counts from 1 where it does not say."""
        declared = self._types.get(element.get("declaredType", ""))
        found = [] if declared is None else declared.findall("Item")
        return {
            integer_of(item, "value") if "value" in item.attrib else index: item.get("name", "")
            for index, item in enumerate(found, start=1)
        }


def _named(elements: Iterable[ET.Element]) -> Iterator[tuple[str, ET.Element]]:
    """Pairs of the attribute `name` and the element that carries the other attributes."""
    for element in elements:
        inner = element[0] if element.tag == "SimpleType" and len(element) else element
        yield element.get("name", ""), inner


def unit_of(name: str | None, units: Mapping[str, Unit]) -> Unit | None:
    """The unit of a name as its owner defines it, or as it is commonly read where he does not.

    None where there is none, or one of an unknown name: a definition without BaseUnit is legal, and
    says nothing but the name.
    """
    if not name or name in units:
        return units.get(name or "")
    known = parse(spelled(name)) if spelled(name) else None
    return None if known is None else replace(known, symbol=name)
