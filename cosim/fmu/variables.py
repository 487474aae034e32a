"""Variables of an FMU, as elements of its modelDescription.xml say them."""

from __future__ import annotations

import itertools
import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

from ..reading.limits import VALUES
from ..spec.units import Unit
from .attributes import (
    INITIALS,
    VARIABILITIES,
    Start,
    Types,
    Unsound,
    initial_of,
    integer_of,
    named,
    needed,
    one_of,
    start_of,
    unit_of,
)  # fmt: skip

Causality = Literal[
    "parameter", "calculatedParameter", "structuralParameter", "input", "output", "local",
    "independent",
]  # fmt: skip
_TRUE = ("true", "1")
FMI2_TYPES = {
    "Real": "Float64", "Integer": "Int32", "Enumeration": "Enumeration2", "Boolean": "Boolean2",
    "String": "String",
}  # fmt: skip
FMI3_TYPES = (
    "Float64", "Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64",
    "Boolean", "Enumeration", "String", "Binary", "Clock",
)  # fmt: skip


@dataclass(frozen=True)
class Variable:
    """One variable; an array of FMI 3 is one variable with `size` values.

    Attributes:
        name: as in the FMU; vectors of scalars are named `q[1]` ... `q[n]`.
        reference: its value reference.
        type: `Float64`, `Int32`, `Boolean` ..., `Boolean2` for the Boolean of FMI 2 (an int).
        causality, variability, initial: as in the FMU, with FMI's defaults filled in.
        unit: None where the FMU declares none.
        start: start values, one per element.
        minimum, maximum, nominal: None where open.
        dimensions: of an array of FMI 3, () for a scalar.
        index: of an element of an array, its position among the array's values; else None.
        relative: a difference, so that the offset of its unit does not count (FMI 2's
            relativeQuantity).
        intermediate: an FMU of FMI 3 lets its importer set or get it within a step
            (intermediateUpdate).
        items: of an enumeration, what its values are called.
        alias: of an alias of FMI 3, the variable whose second name it is; else "".
    """

    name: str
    reference: int
    type: str
    causality: str
    variability: str
    initial: str = ""
    unit: Unit | None = None
    start: tuple[Start, ...] = ()
    minimum: float | None = None
    maximum: float | None = None
    nominal: float | None = None
    text: str = ""
    dimensions: tuple[int, ...] = ()
    index: int | None = None
    relative: bool = False
    intermediate: bool = False
    items: Mapping[int, str] | None = None
    alias: str = ""

    @property
    def size(self) -> int:
        """Number of values behind the value reference."""
        return math.prod(self.dimensions)

    @property
    def symbol(self) -> str:
        """The unit as written in the FMU, "" where it has none."""
        return self.unit.symbol if self.unit else ""

    def elements(self) -> tuple[str, ...]:
        """Names of the scalar elements: `q[1]` of a vector, `A[2,1]` of a matrix, row by row."""
        if not self.dimensions:
            return (self.name,)
        places = itertools.product(*(range(1, count + 1) for count in self.dimensions))
        return tuple(f"{self.name}[{','.join(map(str, place))}]" for place in places)

    def element(self, index: int) -> Variable:
        """One element of an array, as a scalar variable."""
        start = (self.start[index],) if len(self.start) == self.size else ()
        name = self.elements()[index]
        return replace(self, name=name, dimensions=(), index=index, start=start)


def read_variables(
    root: ET.Element, units: Mapping[str, Unit], fmi: Literal[2, 3]
) -> list[Variable]:
    """The variables of a description, in its order; aliases of FMI 3 behind theirs.

    Raises:
        Unsound: what is there would be silently wrong.
    """
    variables = _variables2(root, units) if fmi == 2 else _variables3(root, units)
    names: set[str] = set()
    for variable in variables:
        if variable.name in names:
            raise Unsound(
                f"has two variables named {variable.name!r}, so a value would go to either; names "
                "must be unique"
            )
        names.add(variable.name)
        if not 0 <= variable.reference < 2**32:
            raise Unsound(
                f"variable {variable.name!r} has the value reference {variable.reference}, which "
                "is not a whole number of 32 bits (0 to 4294967295); export it again"
            )
    return variables


def _variable(
    element: ET.Element,
    inner: ET.Element,
    type_: str,
    types: Types,
    units: Mapping[str, Unit],
    **more: Any,
) -> Variable:
    """A variable, with FMI's defaults filled in.

    Args:
        element: that says what it is.
        inner: that says what its type is; of FMI 3 the same.
        type_: its name here.
        types: that are declared.
        units: that are declared.
        more: its other attributes.
    """
    causality = one_of(element, "causality", get_args(Causality), "local")
    default = "continuous" if type_ in ("Float64", "Float32") else "discrete"
    variability = one_of(element, "variability", VARIABILITIES, default)
    given = one_of(element, "initial", INITIALS, "")
    return Variable(
        name=needed(element, "name"),
        reference=integer_of(element, "valueReference"),
        type=type_,
        causality=causality,
        variability=variability,
        initial=initial_of(given, causality, variability),
        unit=unit_of(types.get(inner, "unit"), units),
        minimum=types.number(inner, "min"),
        maximum=types.number(inner, "max"),
        nominal=types.number(inner, "nominal"),
        text=element.get("description", ""),
        relative=types.get(inner, "relativeQuantity") in _TRUE,
        items=types.items(inner) if type_.startswith("Enumeration") else None,
        **more,
    )


def _variables2(root: ET.Element, units: Mapping[str, Unit]) -> list[Variable]:
    types = Types(root.iterfind("TypeDefinitions/SimpleType"))
    found = []
    for element in root.iterfind("ModelVariables/ScalarVariable"):
        inner = next((child for child in element if child.tag in FMI2_TYPES), None)
        if inner is None:
            raise Unsound(f"{named(element)} has no type ({', '.join(FMI2_TYPES)})")
        type_ = FMI2_TYPES[inner.tag]
        start = start_of(inner, type_)
        found.append(_variable(element, inner, type_, types, units, start=start))
    return found


def _length(element: ET.Element, dimension: ET.Element, starts: Mapping[int, Start]) -> int:
    if "start" in dimension.attrib:
        return integer_of(dimension, "start")
    reference = integer_of(dimension, "valueReference")
    if reference not in starts:
        raise Unsound(
            f"{named(element)} has as many elements as value reference {reference}, which is no "
            "UInt64"
        )
    return int(starts[reference] or 0)


def _dimensions(element: ET.Element, starts: Mapping[int, Start]) -> tuple[int, ...]:
    """Numbers of elements; a structural parameter has the one of its start value."""
    found = tuple(
        _length(element, dimension, starts) for dimension in element.iterfind("Dimension")
    )
    if not found:
        return ()
    if min(found) < 0:
        raise Unsound(f"variable {element.get('name')!r} has {min(found)} elements")
    if excess := VALUES.excess(math.prod(found)):
        raise Unsound(f"variable {element.get('name')!r}: {excess}")
    return found


def _variables3(root: ET.Element, units: Mapping[str, Unit]) -> list[Variable]:
    types = Types(root.iterfind("TypeDefinitions/*"))
    elements = [e for e in root.iterfind("ModelVariables/*") if e.tag in FMI3_TYPES]
    structural = {
        integer_of(e, "valueReference"): (start_of(e, "UInt64") or (None,))[0]
        for e in elements
        if e.tag == "UInt64"
    }
    found: list[Variable] = []
    total, most = 0, VALUES.value()
    for element in elements:
        type_ = element.tag
        dimensions = _dimensions(element, structural)
        total += math.prod(dimensions) * (1 + len(element.findall("Alias")))
        if total > most:
            raise Unsound(f"its variables together: {VALUES.excess(total)}")
        inner = element.findall("Start")  # of strings and binaries, one per element
        start = (
            tuple(value for item in inner for value in start_of(item, type_, "value"))
            if inner
            else start_of(element, type_)
        )
        if dimensions and len(start) == 1:
            start = start * math.prod(dimensions)
        intermediate = element.get("intermediateUpdate") in _TRUE
        more = {"start": start, "dimensions": dimensions, "intermediate": intermediate}
        found.append(_variable(element, element, type_, types, units, **more))
        found += [
            replace(
                found[-1],
                name=needed(alias, "name"),
                text=alias.get("description", ""),
                alias=found[-1].name,
            )
            for alias in element.iterfind("Alias")
        ]
    return found
