"""What an FMU says about itself: modelDescription.xml of FMI 2.0 and 3.0, as plain objects.

A small parser of its own, so that both versions give the same objects (with units as SI exponents
and with direct feedthrough), without validating the whole file at each load; `cosim fmus check`
validates.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from .. import markup
from ..errors import FmuFileError, UnknownNameError, listing
from ..limits import TEXT, VALUES
from ..spec.units import BASE, Unit
from .metadata import read_metadata

Causality = Literal[
    "parameter", "calculatedParameter", "structuralParameter", "input", "output", "local",
    "independent",
]  # fmt: skip
Start = float | bool | str | None

FMI2_TYPES = {
    "Real": "Float64", "Integer": "Int32", "Enumeration": "Int32", "Boolean": "Boolean2",
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
        size: number of values behind the value reference.
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
    size: int = 1

    @property
    def symbol(self) -> str:
        """The unit as written in the FMU, "" where it has none."""
        return self.unit.symbol if self.unit else ""

    def elements(self) -> tuple[str, ...]:
        """Names of the scalar elements."""
        if self.size == 1:
            return (self.name,)
        return tuple(f"{self.name}[{index + 1}]" for index in range(self.size))


@dataclass(frozen=True)
class PowerPort:
    """Two groups of variables whose products are power, as our own FMUs declare them.

    Attributes:
        name: e.g. `flange_b`.
        effort, flow: names of the scalar variables, pairwise.
        sign: power INTO the component = sign * sum(effort * flow).
        causality: `gives_motion` or `gives_effort`.
    """

    name: str
    effort: tuple[str, ...]
    flow: tuple[str, ...]
    sign: int
    causality: str


@dataclass(frozen=True)
class Description:
    """A model description.

    Attributes:
        fmi: 2 or 3.
        name: the model's name; for our own FMUs the variant.
        token: GUID or instantiation token.
        identifier: model identifier of the co-simulation interface.
        variables: by name, in the FMU's order.
        dependencies: per output the inputs that it depends on directly.
        assumed: outputs whose dependencies the FMU does not declare (then it is all inputs).
        capabilities: attributes of the co-simulation interface.
        start, stop, step, tolerance: of the default experiment, None where not given.
        ports: power ports, from `extra/cosim/component.json`.
        extra: the whole of that file, empty for foreign FMUs.
    """

    fmi: Literal[2, 3]
    name: str
    token: str
    identifier: str
    variables: Mapping[str, Variable]
    dependencies: Mapping[str, tuple[str, ...]]
    assumed: frozenset[str]
    capabilities: Mapping[str, str]
    text: str = ""
    tool: str = ""
    version: str = ""
    start: float | None = None
    stop: float | None = None
    step: float | None = None
    tolerance: float | None = None
    ports: tuple[PowerPort, ...] = ()
    extra: Mapping[str, Any] = field(default_factory=dict)

    def can(self, capability: str) -> bool:
        """A boolean capability; FMI 2's and FMI 3's spelling are both accepted."""
        spellings = (
            capability,
            capability.replace("FMUState", "FMUstate"),
            capability.replace("Derivatives", "Derivative"),
        )
        return any(self.capabilities.get(spelling) in ("true", "1") for spelling in spellings)

    def of(self, causality: Causality) -> list[Variable]:
        """The variables of one causality."""
        return [v for v in self.variables.values() if v.causality == causality]

    def find(self, name: str) -> Variable:
        """A variable by name.

        Raises:
            UnknownNameError: with the nearest names.
        """
        if name not in self.variables:
            ordered = sorted(self.variables.values(), key=lambda v: v.causality == "local")
            names = [v.name for v in ordered]
            raise UnknownNameError(f"{self.name} has no variable {name!r}; {listing(names, name)}")
        return self.variables[name]

    def expand(self, name: str) -> list[Variable]:
        """The variable `q`, or all of the vector `q[1]` ... `q[n]`.

        Raises:
            UnknownNameError: neither exists.
        """
        if name in self.variables:
            return [self.variables[name]]
        found: list[Variable] = []
        while f"{name}[{len(found) + 1}]" in self.variables:
            found.append(self.variables[f"{name}[{len(found) + 1}]"])
        return found or [self.find(name)]


def _number(element: ET.Element, key: str) -> float | None:
    text = element.get(key)
    return None if text is None else float(text)


def read_units(elements: Iterable[ET.Element], namespace: str = "") -> dict[str, Unit]:
    """Units by name, from elements `Unit` of FMI (or of SSP, which has them in a namespace)."""
    units = {}
    for element in elements:
        base = element.find(f"{namespace}BaseUnit")
        name = element.get("name", "")
        if base is not None:
            factor, offset = float(base.get("factor", "1")), float(base.get("offset", "0"))
            if not (math.isfinite(factor) and factor and math.isfinite(offset)):
                raise ValueError(f"unit {name!r} has factor {factor} and offset {offset}")
            exponents = tuple(int(base.get(key, "0")) for key in BASE)
            units[name] = Unit(name, exponents, factor, offset)
    return units


def _start(text: str | None, type_: str) -> tuple[Start, ...]:
    if text is None:
        return ()
    if type_ in ("String", "Binary"):
        return (text,)
    items = text.split()
    if type_.startswith("Boolean"):
        return tuple(item in ("true", "1") for item in items)
    return tuple(float(item) for item in items)


class _Unsound(Exception):
    """A description that cannot be used; the text says why and the way out."""


class _Types:
    """Attributes that a variable inherits from the type it declares."""

    def __init__(self, elements: Iterable[ET.Element]) -> None:
        self._types = dict(_named(elements))

    def get(self, element: ET.Element, key: str) -> str | None:
        value = element.get(key)
        if value is None:
            declared = self._types.get(element.get("declaredType", ""))
            value = declared.get(key) if declared is not None else None
        return value

    def number(self, element: ET.Element, key: str) -> float | None:
        text = self.get(element, key)
        return None if text is None else float(text)


def _named(elements: Iterable[ET.Element]) -> Iterator[tuple[str, ET.Element]]:
    """Pairs of the attribute `name` and the element that carries the other attributes."""
    for element in elements:
        inner = element[0] if element.tag == "SimpleType" and len(element) else element
        yield element.get("name", ""), inner


def _unit(name: str | None, units: Mapping[str, Unit]) -> Unit | None:
    return units.get(name) if name else None


def _variables2(root: ET.Element, units: Mapping[str, Unit]) -> list[Variable]:
    types = _Types(root.iterfind("TypeDefinitions/SimpleType"))
    found = []
    for element in root.iterfind("ModelVariables/ScalarVariable"):
        inner = next(child for child in element if child.tag in FMI2_TYPES)
        type_ = FMI2_TYPES[inner.tag]
        default = "continuous" if inner.tag == "Real" else "discrete"
        found.append(
            Variable(
                name=element.attrib["name"],
                reference=int(element.attrib["valueReference"]),
                type=type_,
                causality=element.get("causality", "local"),
                variability=element.get("variability", default),
                initial=element.get("initial", ""),
                unit=_unit(types.get(inner, "unit"), units),
                start=_start(inner.get("start"), type_),
                minimum=types.number(inner, "min"),
                maximum=types.number(inner, "max"),
                nominal=types.number(inner, "nominal"),
                text=element.get("description", ""),
            )
        )
    return found


def _size(element: ET.Element, starts: Mapping[int, Start]) -> int:
    size = 1
    for dimension in element.iterfind("Dimension"):
        if "start" in dimension.attrib:
            size *= int(dimension.attrib["start"])
        else:
            size *= int(starts.get(int(dimension.attrib["valueReference"])) or 1)
    if size < 1:
        raise _Unsound(f"variable {element.get('name')!r} has {size} elements; give it some")
    if excess := VALUES.excess(size):
        raise _Unsound(f"variable {element.get('name')!r}: {excess}")
    return size


def _variables3(root: ET.Element, units: Mapping[str, Unit]) -> list[Variable]:
    types = _Types(root.iterfind("TypeDefinitions/*"))
    elements = [e for e in root.iterfind("ModelVariables/*") if e.tag in FMI3_TYPES]
    structural = {
        int(e.attrib["valueReference"]): (_start(e.get("start"), "UInt64") or (None,))[0]
        for e in elements
        if e.tag == "UInt64"
    }
    found: list[Variable] = []
    total = 0
    for element in elements:
        type_ = "Int64" if element.tag == "Enumeration" else element.tag
        size = _size(element, structural)
        total += size
        if excess := VALUES.excess(total):
            raise _Unsound(f"its variables together: {excess}")
        inner = element.find("Start")
        text = inner.get("value") if inner is not None else element.get("start")
        start = _start(text, type_)
        if size > 1 and len(start) == 1:
            start = start * size
        default = "continuous" if element.tag in ("Float64", "Float32") else "discrete"
        found.append(
            Variable(
                name=element.attrib["name"],
                reference=int(element.attrib["valueReference"]),
                type=type_,
                causality=element.get("causality", "local"),
                variability=element.get("variability", default),
                initial=element.get("initial", ""),
                unit=_unit(types.get(element, "unit"), units),
                start=start,
                minimum=types.number(element, "min"),
                maximum=types.number(element, "max"),
                nominal=types.number(element, "nominal"),
                text=element.get("description", ""),
                size=size,
            )
        )
    return found


def _dependencies(
    unknowns: Iterable[tuple[Variable, ET.Element]],
    known: Mapping[int, Variable],
    inputs: tuple[str, ...],
) -> tuple[dict[str, tuple[str, ...]], frozenset[str]]:
    found: dict[str, tuple[str, ...]] = {}
    assumed = set()
    for variable, element in unknowns:
        text = element.get("dependencies")
        if text is None:
            found[variable.name] = inputs
            assumed.add(variable.name)
        else:
            names = [known[int(item)].name for item in text.split() if int(item) in known]
            found[variable.name] = tuple(name for name in names if name in inputs)
    return found, frozenset(assumed)


def _check(variables: Iterable[Variable], identifier: str) -> None:
    """Refuse what would be silently wrong, or lead out of the FMU's folder."""
    names: set[str] = set()
    for variable in variables:
        if variable.name in names:
            raise _Unsound(
                f"has two variables named {variable.name!r}, so a value would go to either; names "
                "must be unique"
            )
        names.add(variable.name)
        if not 0 <= variable.reference < 2**32:
            raise _Unsound(
                f"variable {variable.name!r} has the value reference {variable.reference}, which "
                "is not a whole number of 32 bits (0 to 4294967295); export it again"
            )
    if not identifier or set(identifier) & set("/\\:"):
        raise _Unsound(f"modelIdentifier {identifier!r} is not the name of a file")


def _ports(extra: Mapping[str, Any]) -> tuple[PowerPort, ...]:
    return tuple(
        PowerPort(
            port["name"],
            tuple(port["effort"]),
            tuple(port["flow"]),
            int(port["sign"]),
            port["causality"],
        )
        for port in extra.get("ports", [])
    )


def parse_description(xml: bytes, extra: Mapping[str, Any], where: str) -> Description:
    """Parse a model description.

    Args:
        xml: content of modelDescription.xml.
        extra: content of extra/cosim/component.json.
        where: file name for error texts.

    Raises:
        FmuFileError: not XML, not FMI 2 or 3, or without co-simulation.
    """
    try:
        root = markup.parse(xml).root
    except markup.MarkupError as error:
        raise FmuFileError(
            f"{where}: modelDescription.xml cannot be read ({error}); build or fetch the file again"
        ) from error
    version = root.get("fmiVersion", "")
    if root.tag != "fmiModelDescription" or not version.startswith(("2.", "3.")):
        raise FmuFileError(
            f"{where}: is of FMI version {version or 'unknown'}; FMI 2.0 and 3.0 are supported"
        )
    interface = root.find("CoSimulation")
    if interface is None:
        raise FmuFileError(f"{where}: has no co-simulation interface; export it for co-simulation")
    try:
        return _assemble(root, interface, extra, 2 if version.startswith("2.") else 3)
    except _Unsound as error:
        raise FmuFileError(f"{where}: modelDescription.xml: {error}") from None
    except (KeyError, ValueError, StopIteration, IndexError, OverflowError) as error:
        raise FmuFileError(
            f"{where}: modelDescription.xml is not valid ({type(error).__name__}: {error}); "
            "'cosim fmus check' lists its problems"
        ) from error


def _assemble(
    root: ET.Element, interface: ET.Element, extra: Mapping[str, Any], fmi: Literal[2, 3]
) -> Description:
    units = read_units(root.iterfind("UnitDefinitions/Unit"))
    variables = _variables2(root, units) if fmi == 2 else _variables3(root, units)
    _check(variables, interface.get("modelIdentifier", ""))
    inputs = tuple(v.name for v in variables if v.causality == "input")
    if fmi == 2:
        indexed = {index + 1: v for index, v in enumerate(variables)}
        unknowns = [
            (indexed[int(e.attrib["index"])], e)
            for e in root.iterfind("ModelStructure/Outputs/Unknown")
        ]
    else:
        indexed = {v.reference: v for v in variables}
        unknowns = [
            (indexed[int(e.attrib["valueReference"])], e)
            for e in root.iterfind("ModelStructure/Output")
        ]
    dependencies, assumed = _dependencies(unknowns, indexed, inputs)
    for variable in variables:
        if variable.causality == "output" and variable.name not in dependencies:
            dependencies[variable.name] = inputs
            assumed |= {variable.name}
    experiment = root.find("DefaultExperiment")
    experiment = ET.Element("DefaultExperiment") if experiment is None else experiment
    return Description(
        fmi=fmi,
        name=root.get("modelName", ""),
        token=root.get("guid" if fmi == 2 else "instantiationToken", ""),
        identifier=interface.attrib["modelIdentifier"],
        variables={v.name: v for v in variables},
        dependencies=dependencies,
        assumed=assumed,
        capabilities=dict(interface.attrib),
        text=root.get("description", ""),
        tool=root.get("generationTool", ""),
        version=root.get("version", ""),
        start=_number(experiment, "startTime"),
        stop=_number(experiment, "stopTime"),
        step=_number(experiment, "stepSize"),
        tolerance=_number(experiment, "tolerance"),
        ports=_ports(extra),
        extra=extra,
    )


def read_description(folder: Path, where: str) -> Description:
    """Read the description of an unpacked FMU.

    Raises:
        FmuFileError: missing or unreadable.
    """
    path = folder / "modelDescription.xml"
    if not path.is_file():
        inside = sorted(item.parent.name for item in folder.glob("*/modelDescription.xml"))
        way_out = (
            f"; the folder {inside[0]!r} inside it has one: pack the content of that folder, not "
            "the folder"
            if inside
            else ", so it is not an FMU"
        )
        raise FmuFileError(f"{where}: has no modelDescription.xml{way_out}")
    extra = read_metadata(folder / "extra" / "cosim" / "component.json", where)
    if excess := TEXT.excess(path.stat().st_size):
        raise FmuFileError(f"{where}: modelDescription.xml: {excess}")
    return parse_description(path.read_bytes(), extra, where)
