"""What an FMU says about itself: modelDescription.xml of FMI 2.0 and 3.0, as plain objects.

A small parser of its own, so that both versions give the same objects (with units as SI exponents
and with direct feedthrough), without validating the whole file at each load; `cosim fmus check`
validates.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from ..errors import FmuFileError, UnknownNameError, listing
from ..reading import markup
from ..reading.limits import TEXT
from .attributes import Unsound, counted, integer_of, named, number_of, read_units, wholes_of
from .metadata import read_metadata
from .variables import Causality, Variable, read_variables


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


def _dependencies(
    unknowns: Iterable[tuple[Variable, ET.Element]],
    known: Mapping[int, Variable],
    inputs: tuple[str, ...],
) -> tuple[dict[str, tuple[str, ...]], frozenset[str]]:
    found: dict[str, tuple[str, ...]] = {}
    assumed, wanted = set(), set(inputs)
    for variable, element in unknowns:
        if "dependencies" not in element.attrib:
            found[variable.name] = inputs
            assumed.add(variable.name)
        else:
            places = wholes_of(element, "dependencies")
            names = [known[place].name for place in places if place in known]
            found[variable.name] = tuple(name for name in names if name in wanted)
    return found, frozenset(assumed)


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
    fmi = fmi_of(version)
    if root.tag != "fmiModelDescription" or fmi is None:
        raise FmuFileError(
            f"{where}: is of FMI version {version or 'unknown'}; FMI 2.0 and 3.0 are supported"
        )
    interface = root.find("CoSimulation")
    if interface is None:
        raise FmuFileError(f"{where}: has no co-simulation interface; export it for co-simulation")
    try:
        return _assemble(root, interface, extra, fmi)
    except Unsound as error:
        raise FmuFileError(f"{where}: modelDescription.xml: {error}") from None


def fmi_of(version: str) -> Literal[2, 3] | None:
    """FMI 2 or 3 by `fmiVersion`, None of a version that is neither.

    There is one FMI 2 (2.0.1 to 2.0.5 say 2.0, too); versions of FMI 3 may add, not change.
    """
    if re.fullmatch(r"2\.0(\.\d+)?", version):
        return 2
    return 3 if re.fullmatch(r"3\.\d+(\.\d+)?(-.*)?", version) else None


def _unknown(element: ET.Element, key: str, variables: Mapping[int, Variable]) -> Variable:
    """The variable that an element of the model structure means."""
    place = integer_of(element, key)
    if place not in variables:
        raise Unsound(
            f"{named(element)} of ModelStructure has {key} {place}, which no variable has"
        )
    return variables[place]


def _assemble(
    root: ET.Element, interface: ET.Element, extra: Mapping[str, Any], fmi: Literal[2, 3]
) -> Description:
    units = read_units(root.iterfind("UnitDefinitions/Unit"))
    variables = read_variables(root, units, fmi)
    identifier = interface.get("modelIdentifier", "")
    if not identifier or set(identifier) & set("/\\:"):
        raise Unsound(f"modelIdentifier {identifier!r} is not the name of a file")
    inputs = tuple(v.name for v in variables if v.causality == "input" and not v.alias)
    if fmi == 2:
        indexed = {index + 1: v for index, v in enumerate(variables)}
        unknowns = [
            (_unknown(e, "index", indexed), e)
            for e in root.iterfind("ModelStructure/Outputs/Unknown")
        ]
    else:
        indexed = {v.reference: v for v in variables if not v.alias}
        unknowns = [
            (_unknown(e, "valueReference", indexed), e)
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
        identifier=identifier,
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
