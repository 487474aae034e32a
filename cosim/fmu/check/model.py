"""A model description as it is written, with lines, before anything is made of it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from ...reading.markup import Markup
from ..attributes import initial_of
from ..variables import FMI2_TYPES, FMI3_TYPES

FLOATS = ("Real", "Float64", "Float32")
RANGES = {
    "Integer": (-(2**31), 2**31 - 1), "Enumeration": (-(2**63), 2**63 - 1),
    **{f"Int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"UInt{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
}  # fmt: skip
"""Smallest and largest value of each whole type (of an enumeration, of FMI 3's)."""


@dataclass(frozen=True, eq=False)
class Declared:
    """A variable as declared; equal to itself only.

    Attributes:
        name: "" where missing.
        line: in modelDescription.xml.
        index: 1 for the first.
        type: element of FMI, `Real`, `Float64`, ...
        outer: the element with name and causality.
        inner: the element with type and start; in FMI 3 the same.
        kind: the type that it declares, None if none of that name.
        fmi: 2 or 3.
    """

    name: str
    line: int
    index: int
    type: str
    outer: ET.Element
    inner: ET.Element
    kind: ET.Element | None
    fmi: Literal[2, 3]

    @property
    def reference(self) -> str:
        """Value reference as written."""
        return self.outer.get("valueReference", "").strip()

    @property
    def causality(self) -> str:
        """With FMI's default filled in."""
        return self.outer.get("causality", "local")

    @property
    def variability(self) -> str:
        """With FMI's default filled in."""
        given = self.outer.get("variability")
        if given is not None:
            return given
        if self.fmi == 2:
            return "continuous"  # also for types that cannot be: they have to say
        if self.causality in ("parameter", "calculatedParameter", "structuralParameter"):
            return "fixed"
        return "continuous" if self.type in FLOATS else "discrete"

    @cached_property
    def initial(self) -> str:
        """With FMI's default filled in; "" where there is none."""
        return initial_of(self.outer.get("initial"), self.causality, self.variability)

    @property
    def start(self) -> str | None:
        """Start value as written."""
        element = self.outer.find("Start")
        return self.inner.get("start") if element is None else element.get("value")

    @property
    def clocked(self) -> bool:
        """Whether it belongs to a clock."""
        return self.outer.get("clocks") is not None

    def get(self, key: str) -> str | None:
        """An attribute, its own or that of its type."""
        value = self.inner.get(key)
        return self.kind.get(key) if value is None and self.kind is not None else value


@dataclass(frozen=True)
class Model:
    """A whole description as declared.

    Attributes:
        root: its element.
        fmi: 2 or 3.
        lines: line of each element.
        variables: in order.
        types: name -> element that carries the attributes.
    """

    root: ET.Element
    fmi: Literal[2, 3]
    lines: Markup
    variables: tuple[Declared, ...]
    types: dict[str, ET.Element]

    def line(self, element: ET.Element) -> int:
        """Line of an element."""
        return self.lines.lines[element]

    @cached_property
    def referred(self) -> dict[str, Declared]:
        """Variables by what refers to them: index in FMI 2, value reference in FMI 3."""
        if self.fmi == 2:
            return {str(variable.index): variable for variable in self.variables}
        return {_plain(variable.reference): variable for variable in self.variables}

    def refers(self, text: str) -> Declared | None:
        """The variable that an index (FMI 2) or value reference (FMI 3) means."""
        return self.referred.get(_plain(text))

    @property
    def reference_name(self) -> str:
        """What refers to variables."""
        return "index" if self.fmi == 2 else "valueReference"


def _plain(text: str) -> str:
    """A whole number without signs and leading zeros."""
    text = text.strip()
    return str(int(text)) if text.isascii() and text.isdigit() and len(text) < 20 else text


def named_types(root: ET.Element, fmi: Literal[2, 3]) -> Iterator[tuple[str, ET.Element]]:
    """Type definitions: name, and the element that carries the attributes."""
    for element in root.iterfind("TypeDefinitions/*"):
        inner = element
        if fmi == 2:
            found = [child for child in element if child.tag in FMI2_TYPES]
            if not found:
                continue
            inner = found[0]
        yield element.get("name", ""), inner


def read_model(markup: Markup, fmi: Literal[2, 3]) -> Model:
    """The declarations of a parsed description."""
    types = dict(named_types(markup.root, fmi))
    variables = []
    place = "ModelVariables/ScalarVariable" if fmi == 2 else "ModelVariables/*"
    for index, outer in enumerate(markup.root.iterfind(place), 1):
        inner: ET.Element | None = outer
        if fmi == 2:
            inner = next((child for child in outer if child.tag in FMI2_TYPES), None)
        elif outer.tag not in FMI3_TYPES:
            continue
        if inner is None:
            continue  # the schema says so
        variables.append(
            Declared(
                outer.get("name", ""), markup.lines[outer], index, inner.tag, outer, inner,
                types.get(inner.get("declaredType", "")), fmi,
            )
        )  # fmt: skip
    return Model(markup.root, fmi, markup, tuple(variables), types)
