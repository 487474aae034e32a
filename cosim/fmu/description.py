"""What an FMU says about itself: modelDescription.xml of FMI 2.0 and 3.0, as plain objects.

A small parser of its own, so that both versions give the same objects (with units as SI exponents
and with direct feedthrough), without validating the whole file at each load; `cosim fmus check`
validates.
"""

from __future__ import annotations

import itertools
import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from ..errors import FmuFileError, UnknownNameError, listing
from ..reading import markup
from ..reading.limits import TEXT, VALUES
from ..spec.units import Unit
from .attributes import (
    Start,
    Types,
    counted,
    initial_of,
    number_of,
    read_units,
    start_of,
    unit_of,
)  # fmt: skip
from .metadata import read_metadata

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

    def moves(self, variable: Variable) -> bool:
        """Whether an input can be moved while a step is under way.

        By derivatives that the FMU is told (FMI 2's canInterpolateInputs), or because it asks for
        values (FMI 3's intermediateUpdate).
        """
        if self.fmi == 2:
            return self.can("canInterpolateInputs")
        return self.can("providesIntermediateUpdate") and variable.intermediate

    def of(self, causality: Causality) -> list[Variable]:
        """The variables of one causality, each under its first name."""
        return [v for v in self.variables.values() if v.causality == causality and not v.alias]

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
        """What a name means: the variable `q`, an element of an array, or scalars that count up.

        FMI 2 has no arrays; there `q` means all of `q[1]`, `q[2]`, ... or `q[0]`, `q[1]`, ...

        Raises:
            UnknownNameError: neither exists.
        """
        if name in self.variables:
            return [self.variables[name]]
        whole = self.variables.get(name.rpartition("[")[0])
        if whole is not None and whole.dimensions:
            wanted, names = name.replace(" ", ""), whole.elements()
            if wanted not in names:
                raise UnknownNameError(
                    f"{self.name} has no element {name!r}: {whole.name} goes from {names[0]} to "
                    f"{names[-1]}"
                    if names
                    else f"{self.name}: {whole.name} is an array without elements"
                )
            return [whole.element(names.index(wanted))]
        return counted(self.name, name, self.variables) or [self.find(name)]

    def whole(self, name: str) -> Variable:
        """The variable of the FMU that holds a scalar element (`x` for `x[2]` of an array)."""
        return self.variables.get(name) or self.find(name.rpartition("[")[0])


class _Unsound(Exception):
    """A description that cannot be used; the text says why and the way out."""


def _variables2(root: ET.Element, units: Mapping[str, Unit]) -> list[Variable]:
    types = Types(root.iterfind("TypeDefinitions/SimpleType"))
    found = []
    for element in root.iterfind("ModelVariables/ScalarVariable"):
        inner = next(child for child in element if child.tag in FMI2_TYPES)
        type_ = FMI2_TYPES[inner.tag]
        causality = element.get("causality", "local")
        default = "continuous" if inner.tag == "Real" else "discrete"
        variability = element.get("variability", default)
        found.append(
            Variable(
                name=element.attrib["name"],
                reference=int(element.attrib["valueReference"]),
                type=type_,
                causality=causality,
                variability=variability,
                initial=initial_of(element.get("initial"), causality, variability),
                unit=unit_of(types.get(inner, "unit"), units),
                start=start_of(inner.get("start"), type_),
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
            else starts[int(dimension.attrib["valueReference"])] or 0
        )
        for dimension in element.iterfind("Dimension")
    )
    if not found:
        return ()
    if min(found) < 0:
        raise _Unsound(f"variable {element.get('name')!r} has {min(found)} elements")
    if excess := VALUES.excess(math.prod(found)):
        raise _Unsound(f"variable {element.get('name')!r}: {excess}")
    return found


def _variables3(root: ET.Element, units: Mapping[str, Unit]) -> list[Variable]:
    types = Types(root.iterfind("TypeDefinitions/*"))
    elements = [e for e in root.iterfind("ModelVariables/*") if e.tag in FMI3_TYPES]
    structural = {
        int(e.attrib["valueReference"]): (start_of(e.get("start"), "UInt64") or (None,))[0]
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
            raise _Unsound(f"its variables together: {VALUES.excess(total)}")
        inner = element.findall("Start")  # of strings and binaries, one per element
        start = (
            tuple(value for item in inner for value in start_of(item.get("value"), type_))
            if inner
            else start_of(element.get("start"), type_)
        )
        if dimensions and len(start) == 1:
            start = start * math.prod(dimensions)
        causality = element.get("causality", "local")
        default = "continuous" if element.tag in ("Float64", "Float32") else "discrete"
        variability = element.get("variability", default)
        found.append(
            Variable(
                name=element.attrib["name"],
                reference=int(element.attrib["valueReference"]),
                type=type_,
                causality=causality,
                variability=variability,
                initial=initial_of(element.get("initial"), causality, variability),
                unit=unit_of(types.get(element, "unit"), units),
                start=start,
                minimum=types.number(element, "min"),
                maximum=types.number(element, "max"),
                nominal=types.number(element, "nominal"),
                text=element.get("description", ""),
                dimensions=dimensions,
                relative=types.get(element, "relativeQuantity") in _TRUE,
                intermediate=element.get("intermediateUpdate") in _TRUE,
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
    assumed, wanted = set(), set(inputs)
    for variable, element in unknowns:
        text = element.get("dependencies")
        if text is None:
            found[variable.name] = inputs
            assumed.add(variable.name)
        else:
            names = [known[int(item)].name for item in text.split() if int(item) in known]
            found[variable.name] = tuple(name for name in names if name in wanted)
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
        start=number_of(experiment, "startTime"),
        stop=number_of(experiment, "stopTime"),
        step=number_of(experiment, "stepSize"),
        tolerance=number_of(experiment, "tolerance"),
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
