"""modelDescription.xml of FMI 2.0 and 3.0 read as a `description.Description`.

A small parser of its own, so that both versions give the same objects (with units as SI exponents
and with direct feedthrough), without validating the whole file at each load; `cosim fmus check`
validates.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from .. import markup
from ..errors import FmuFileError
from ..limits import TEXT, VALUES
from ..spec.units import BASE, Unit
from .description import INTEGERS, Description, PowerPort, Start, Variable
from .metadata import read_metadata

_TRUE = ("true", "1")
FMI2_TYPES = {
    "Real": "Float64", "Integer": "Int32", "Enumeration": "Enumeration2", "Boolean": "Boolean2",
    "String": "String",
}  # fmt: skip
FMI3_TYPES = (
    "Float64", "Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64",
    "Boolean", "Enumeration", "String", "Binary", "Clock",
)  # fmt: skip


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
    if type_ == "String":
        return (text,)
    if type_ == "Binary":
        return (bytes.fromhex(text),)
    items = text.split()
    if type_.startswith("Boolean"):
        return tuple(item in ("true", "1") for item in items)
    if type_ in INTEGERS:
        return tuple(int(item) for item in items)
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

    def items(self, element: ET.Element) -> dict[int, str]:
        """Names of the values of an enumeration; FMI 2 counts from 1 where it does not say."""
        declared = self._types.get(element.get("declaredType", ""))
        found = [] if declared is None else declared.findall("Item")
        return {
            int(item.get("value", index)): item.get("name", "")
            for index, item in enumerate(found, start=1)
        }


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
                relative=inner.tag == "Real" and types.get(inner, "relativeQuantity") in _TRUE,
                items=types.items(inner) if inner.tag == "Enumeration" else None,
            )
        )
    return found


def _dimensions(element: ET.Element, starts: Mapping[int, Start]) -> tuple[int, ...]:
    """Numbers of elements; a structural parameter has the one of its start value."""
    found = tuple(
        int(
            dimension.attrib["start"]
            if "start" in dimension.attrib
            else starts.get(int(dimension.attrib["valueReference"])) or 0
        )
        for dimension in element.iterfind("Dimension")
    )
    size = math.prod(found)
    if size < 1:
        raise _Unsound(f"variable {element.get('name')!r} has {size} elements; give it some")
    if excess := VALUES.excess(size):
        raise _Unsound(f"variable {element.get('name')!r}: {excess}")
    return found


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
        type_ = element.tag
        dimensions = _dimensions(element, structural)
        total += math.prod(dimensions)
        if excess := VALUES.excess(total):
            raise _Unsound(f"its variables together: {excess}")
        inner = element.findall("Start")  # of strings and binaries, one per element
        start = (
            tuple(value for item in inner for value in _start(item.get("value"), type_))
            if inner
            else _start(element.get("start"), type_)
        )
        if dimensions and len(start) == 1:
            start = start * math.prod(dimensions)
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
                dimensions=dimensions,
                relative=types.get(element, "relativeQuantity") in _TRUE,
                items=types.items(element) if type_ == "Enumeration" else None,
            )
        )
        found += [
            replace(
                found[-1],
                name=alias.attrib["name"],
                text=alias.get("description", ""),
                alias=element.attrib["name"],
            )
            for alias in element.iterfind("Alias")
        ]
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
    inputs = tuple(v.name for v in variables if v.causality == "input" and not v.alias)
    if fmi == 2:
        indexed = {index + 1: v for index, v in enumerate(variables)}
        unknowns = [
            (indexed[int(e.attrib["index"])], e)
            for e in root.iterfind("ModelStructure/Outputs/Unknown")
        ]
    else:
        indexed = {v.reference: v for v in variables if not v.alias}
        unknowns = [
            (indexed[int(e.attrib["valueReference"])], e)
            for e in root.iterfind("ModelStructure/Output")
        ]
    dependencies, assumed = _dependencies(unknowns, indexed, inputs)
    for variable in variables:
        if variable.alias:
            continue
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
