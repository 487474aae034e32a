"""Parameter sets (SSV) and parameter mappings (SSM): names and values, as a binding gives them."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path

from ..errors import UnitError
from ..spec.units import Unit, conversion
from .document import (
    INTEGERS,
    NAMES,
    REALS,
    SSV,
    Binding,
    File,
    Transformation,
    read_transformation,
    units_of,
)

Scalar = float | int | bool | str


@dataclass(frozen=True)
class Value:
    """A value on its way to a variable.

    Attributes:
        values: one, or those of an array.
        kind: `number`, `boolean`, `text` or `item` (of an enumeration, by name).
        unit: of numbers, None if not given.
        steps: what a mapping does to it: (transformation, unit conversion suppressed).
        origin: where it comes from, for error texts.
        file: the same.
    """

    values: tuple[Scalar, ...]
    kind: str
    unit: Unit | None
    origin: str
    file: File
    steps: tuple[tuple[Transformation, bool], ...] = ()

    def given(
        self, unit: Unit | None, items: Mapping[str, int], relative: bool = False
    ) -> list[Scalar]:
        """What a variable with this unit and these enumeration items is given.

        Args:
            unit, items: of the variable.
            relative: it is a difference, which offsets of units do not move.

        Raises:
            ScenarioError, UnitError: it does not fit.
        """
        return [self._one(value, unit, items, relative) for value in self.values]

    def _one(
        self, value: Scalar, unit: Unit | None, items: Mapping[str, int], relative: bool
    ) -> Scalar:
        own = self.unit
        for transformation, suppressed in self.steps or ((Transformation(), False),):
            if own is not None and unit is not None and not suppressed:
                try:
                    gain, shift = conversion(own, unit)
                    offset = 0.0 if relative else shift
                except UnitError as error:
                    raise UnitError(f"{self.file.shown}: {self.origin}: unit {error}") from error
                if (gain, offset) != (1.0, 0.0):
                    value = float(value) * gain + offset
            own = None
            value = self._transformed(value, transformation)
        if self.kind == "item":
            if value not in items:
                raise self.file.error(
                    f"{self.origin}: {value!r} is no item of the variable's enumeration"
                )
            return items[str(value)]
        return value

    def _transformed(self, value: Scalar, transformation: Transformation) -> Scalar:
        if transformation.kind == "linear":
            plain = (transformation.factor, transformation.offset) == (1.0, 0.0)
            if plain or isinstance(value, (bool, str)):
                return value
            return transformation.factor * value + transformation.offset
        entries = transformation.entries or {}
        if transformation.kind == "enumeration":
            return entries.get(str(value), str(value))
        boolean = transformation.kind == "boolean"
        parse = _boolean if boolean else _number
        try:
            table = {parse(source): parse(target) for source, target in entries.items()}
        except ValueError as error:
            raise self.file.error(f"{self.origin}: mapping: {error}") from None
        return table.get(value, value) if isinstance(value, (bool, int, float)) else value


def _number(text: str) -> int | float:
    """A number; a whole one with all its digits."""
    return int(text) if re.fullmatch(r"\s*[+-]?\d{1,20}\s*", text, flags=re.ASCII) else float(text)


def _boolean(text: str) -> bool:
    if text.strip() not in ("true", "false", "0", "1"):
        raise ValueError(f"{text!r} is not true or false")
    return text.strip() in ("true", "1")


def read_binding(binding: Binding, what: str, component: Path | None) -> list[tuple[str, Value]]:
    """Names and values that a binding applies, in order.

    Args:
        binding: the binding.
        what: the element that it belongs to, for error texts.
        component: folder of the FMU, if that is a component.

    Raises:
        ScenarioError: it cannot be read.
    """
    file, element = binding.file, binding.element
    kind = element.get("type", "application/x-ssp-parameter-set")
    if kind != "application/x-ssp-parameter-set":
        raise file.error(f"parameter binding of {what} is of type {kind!r}, which cannot be read")
    source = element.get("source")
    if source:
        inside = _base(element, component)
        file = binding.file.beside(source, f"parameter binding of {what}", inside)
        root = file.parse("ssv:ParameterSet")
    else:
        found = element.find("ssd:ParameterValues/ssv:ParameterSet", NAMES)
        if found is None:
            raise file.error(f"parameter binding of {what} has neither source nor ParameterSet")
        root = found
    prefix = element.get("prefix", "")
    values = [(prefix + name, value) for name, value in _read_set(root, file)]
    mapping = element.find("ssd:ParameterMapping", NAMES)
    if mapping is None:
        return values
    return _mapped(values, mapping, binding.file, what, component)


def _base(element: ET.Element, component: Path | None) -> Path | None:
    return component if element.get("sourceBase", "SSD") == "component" else None


def _mapped(
    values: list[tuple[str, Value]],
    mapping: ET.Element,
    file: File,
    what: str,
    component: Path | None,
) -> list[tuple[str, Value]]:
    """The mapped values alone: what a mapping does not name is not applied."""
    source = mapping.get("source")
    if source:
        file = file.beside(source, f"parameter mapping of {what}", _base(mapping, component))
        root = file.parse("ssm:ParameterMapping")
    else:
        found = mapping.find("ssm:ParameterMapping", NAMES)
        if found is None:
            raise file.error(f"parameter mapping of {what} has neither source nor entries")
        root = found
    by_name = dict(values)
    sources = {entry.get("source", "") for entry in root.iterfind("ssm:MappingEntry", NAMES)}
    result = []
    targets: set[str] = set()
    for entry in root.iterfind("ssm:MappingEntry", NAMES):
        name, target = entry.get("source", ""), entry.get("target", "")
        if target in targets:
            raise file.error(f"parameter mapping of {what} maps two parameters to {target!r}")
        targets.add(target)
        if name not in by_name:
            if near := get_close_matches(name, set(by_name) - sources, n=1):
                given = by_name[near[0]].file.name
                raise file.error(
                    f"parameter mapping of {what} names {name!r}, which {given} does not have; "
                    f"did you mean {near[0]!r}?"
                )
            continue
        suppressed = entry.get("suppressUnitConversion", "false") in ("true", "1")
        transformation = read_transformation(entry, file, f"mapping of {name!r}")
        value = by_name[name]
        origin = f"{value.origin}, mapped to {target!r} by {file.name},"
        steps = ((transformation, suppressed),)
        result.append((target, replace(value, steps=steps, origin=origin)))
    return result


def _read_set(root: ET.Element, file: File) -> list[tuple[str, Value]]:
    units = units_of(root, "ssv", file)
    found: list[tuple[str, Value]] = []
    for parameter in root.iterfind("ssv:Parameters/ssv:Parameter", NAMES):
        name = parameter.get("name", "")
        origin = f"parameter {name!r}"
        inner = next((child for child in parameter if child.tag.startswith(f"{{{SSV}}}")), None)
        if inner is None:
            raise file.error(f"{origin} has no value")
        if name in (known for known, _ in found):
            raise file.error(f"{origin} is given twice in one set; the standard allows one")
        found.append((name, _read_value(inner, units, origin, file)))
    return found


def _read_value(inner: ET.Element, units: Mapping[str, Unit], origin: str, file: File) -> Value:
    type_ = inner.tag.rpartition("}")[2]
    text = inner.get("value")
    unit = None
    if name := inner.get("unit"):
        if name not in units:
            raise file.error(f"{origin} has unit {name!r}, which the parameter set does not define")
        unit = units[name]
    try:
        if type_ in REALS or type_ in INTEGERS:
            parse = _number if type_ in INTEGERS else float
            numbers = tuple(parse(item) for item in (text or "").split())
            if not numbers:
                raise ValueError("has no value")
            return Value(numbers, "number", unit, origin, file)
        if type_ == "Boolean":
            flags = tuple(_boolean(item) for item in (text or "").split())
            return Value(flags, "boolean", None, origin, file)
    except ValueError as error:
        raise file.error(f"{origin}: {error}") from None
    texts = (
        (text,)
        if text is not None
        else tuple(item.get("value", "") for item in inner.iterfind("ssv:Value", NAMES))
    )
    if type_ == "String":
        return Value(texts, "text", None, origin, file)
    if type_ == "Enumeration":
        return Value(texts, "item", None, origin, file)
    raise file.error(f"{origin} is of type {type_}, which cannot be given to an FMU")
