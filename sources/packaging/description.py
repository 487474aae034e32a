"""modelDescription.xml for FMI 2.0 and 3.0, from the declarations of a variant."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree as ET

from ..function import Functions
from ..model import Model
from ..units import base_exponents, coherent
from . import rights
from .layout import METHODS, Entry
from .ready import Kind

SOURCE_FILES = ("all.c",)
LOG_CATEGORIES = ("logStatusDiscard", "logStatusError")


def _text(value: float) -> str:
    return repr(float(value))


def _attributes(**values: object) -> dict[str, str]:
    shown = {}
    for name, value in values.items():
        if value is None:
            continue
        if isinstance(value, bool):
            shown[name] = "true" if value else "false"
        elif isinstance(value, float):
            shown[name] = _text(value)
        else:
            shown[name] = str(value)
    return shown


def _units(parent: ET.Element, entries: Sequence[Entry]) -> None:
    definitions = ET.SubElement(parent, "UnitDefinitions")
    for symbol in sorted({entry.quantity.unit for entry in entries}):
        element = ET.SubElement(definitions, "Unit", name=symbol)
        base = {name: str(power) for name, power in base_exponents(coherent(symbol)).items()}
        ET.SubElement(element, "BaseUnit", base)


_CAUSALITY = {
    "time": "independent",
    "state": "local",
    "derivative": "local",
    "input": "input",
    "output": "output",
    "parameter": "parameter",
    "discrete": "local",
    "solver": "parameter",
}


def _variability(entry: Entry) -> str:
    if entry.part == "parameter":
        return entry.quantity.variability
    return {"solver": "tunable", "discrete": "discrete"}.get(entry.part, "continuous")


def _initial(entry: Entry) -> str | None:
    if entry.part in ("output", "derivative"):
        return "calculated"
    return None if entry.part in ("input", "time") else "exact"


def shown_entries(entries: Sequence[Entry]) -> list[tuple[int, Entry]]:
    """(value reference, entry) of the variables that the description lists.

    FMI 2 importers disagree on whether the independent variable may have a start value; it is left
    out there. A variant without states has no solver and shows none.
    """
    has_states = any(entry.part == "state" for entry in entries)
    return [
        (reference, entry)
        for reference, entry in enumerate(entries)
        if entry.part != "time" and (entry.part != "solver" or has_states)
    ]


def _value_attributes(entry: Entry) -> dict[str, str]:
    quantity = entry.quantity
    has_start = _initial(entry) == "exact" or entry.part == "input"
    bounded = entry.part != "derivative"
    return _attributes(
        unit=quantity.unit,
        min=None if quantity.minimum is None or not bounded else float(quantity.minimum),
        max=None if quantity.maximum is None or not bounded else float(quantity.maximum),
        nominal=None if quantity.nominal is None or not bounded else float(quantity.nominal),
        start=float(entry.start) if has_start else None,
    )


def _logs_and_experiment(root: ET.Element) -> None:
    categories = ET.SubElement(root, "LogCategories")
    for category in LOG_CATEGORIES:
        ET.SubElement(categories, "Category", name=category)
    ET.SubElement(
        root, "DefaultExperiment", _attributes(startTime=0.0, stopTime=3.0, stepSize=1e-3)
    )


def _method_items(parent: ET.Element) -> None:
    for name, (value, text) in METHODS.items():
        ET.SubElement(parent, "Item", _attributes(name=name, value=value, description=text))


def _dependencies(entry: Entry, functions: Functions, index: dict[str, int]) -> list[int]:
    """Positions or references of what an entry depends on, as far as `index` knows it."""
    if entry.part == "output":
        names = functions.output_dependencies[entry.name]
    else:
        names = functions.derivative_dependencies[entry.name[4:-1]]
    return sorted(index[name] for name in names if name in index)


def describe_fmi2(
    model: Model,
    functions: Functions,
    entries: Sequence[Entry],
    *,
    identifier: str,
    name: str,
    token: str,
    kind: Kind,
) -> bytes:
    """The FMI 2.0 model description: co-simulation and, for the native kind, model exchange."""
    root = ET.Element(
        "fmiModelDescription",
        _attributes(
            fmiVersion="2.0",
            modelName=name,
            guid=token,
            description=model.component.text,
            **rights.attributes(),
            variableNamingConvention="structured",
            numberOfEventIndicators=0,
        ),
    )
    native = kind == "native"
    if native:
        exchange = ET.SubElement(
            root,
            "ModelExchange",
            _attributes(
                modelIdentifier=identifier,
                completedIntegratorStepNotNeeded=True,
                canNotUseMemoryManagementFunctions=True,
                canGetAndSetFMUstate=True,
                canSerializeFMUstate=True,
                providesDirectionalDerivative=True,
            ),
        )
        _source_files(exchange)
    simulation = ET.SubElement(
        root,
        "CoSimulation",
        _attributes(
            modelIdentifier=identifier,
            needsExecutionTool=None if native else True,
            canHandleVariableCommunicationStepSize=True,
            canInterpolateInputs=True if native else None,
            canNotUseMemoryManagementFunctions=True,
            canGetAndSetFMUstate=True,
            canSerializeFMUstate=True,
            providesDirectionalDerivative=True if native else None,
        ),
    )
    if native:
        _source_files(simulation)
    shown = shown_entries(entries)
    _units(root, [entry for _, entry in shown])
    if any(entry.part == "solver" for _, entry in shown):
        types = ET.SubElement(root, "TypeDefinitions")
        simple = ET.SubElement(types, "SimpleType", name="SolverMethod")
        _method_items(ET.SubElement(simple, "Enumeration"))
    _logs_and_experiment(root)
    variables = ET.SubElement(root, "ModelVariables")
    position = {entry.name: place + 1 for place, (_, entry) in enumerate(shown)}
    for reference, entry in shown:
        variable = ET.SubElement(
            variables,
            "ScalarVariable",
            _attributes(
                name=entry.name,
                valueReference=reference,
                description=entry.quantity.text,
                causality=_CAUSALITY[entry.part],
                variability=_variability(entry),
                initial=_initial(entry),
            ),
        )
        if entry.name == "solver.method":
            ET.SubElement(
                variable,
                "Enumeration",
                _attributes(
                    declaredType="SolverMethod", min=1, max=len(METHODS), start=int(entry.start)
                ),
            )
            continue
        attributes = _value_attributes(entry)
        if entry.part == "derivative":
            attributes["derivative"] = str(position[entry.name[4:-1]])
        ET.SubElement(variable, "Real", attributes)
    structure = ET.SubElement(root, "ModelStructure")
    known = {e.name: position[e.name] for _, e in shown if e.part in ("state", "input")}
    calculated: dict[str, list[tuple[Entry, list[int]]]] = {
        part: [
            (entry, _dependencies(entry, functions, known))
            for _, entry in shown
            if entry.part == part
        ]
        for part in ("output", "derivative")
    }
    sections = [("Outputs", calculated["output"]), ("Derivatives", calculated["derivative"])]
    for title, items in sections:
        if items:
            section = ET.SubElement(structure, title)
            for entry, dependencies in items:
                ET.SubElement(
                    section,
                    "Unknown",
                    _attributes(
                        index=position[entry.name], dependencies=" ".join(map(str, dependencies))
                    ),
                )
    unknowns = [entry for _, items in sections for entry, _ in items]
    if unknowns:
        section = ET.SubElement(structure, "InitialUnknowns")
        for entry in sorted(unknowns, key=lambda item: position[item.name]):
            ET.SubElement(section, "Unknown", _attributes(index=position[entry.name]))
    return _serialize(root)


def describe_fmi3(
    model: Model,
    functions: Functions,
    entries: Sequence[Entry],
    *,
    identifier: str,
    name: str,
    token: str,
) -> bytes:
    """The FMI 3.0 model description of a native FMU: model exchange and co-simulation."""
    root = ET.Element(
        "fmiModelDescription",
        _attributes(
            fmiVersion="3.0",
            modelName=name,
            instantiationToken=token,
            description=model.component.text,
            **rights.attributes(),
            variableNamingConvention="structured",
        ),
    )
    common = _attributes(
        modelIdentifier=identifier,
        canGetAndSetFMUState=True,
        canSerializeFMUState=True,
        providesDirectionalDerivatives=True,
    )
    ET.SubElement(root, "ModelExchange", common)
    simulation = _attributes(
        canHandleVariableCommunicationStepSize=True,
        hasEventMode=True,
        providesIntermediateUpdate=True,
    )
    ET.SubElement(root, "CoSimulation", common | simulation)
    listed = [entries[0], *(entry for _, entry in shown_entries(entries))]
    _units(root, listed)
    if any(entry.part == "solver" for entry in listed):
        types = ET.SubElement(root, "TypeDefinitions")
        _method_items(ET.SubElement(types, "EnumerationType", name="SolverMethod"))
    _logs_and_experiment(root)
    variables = ET.SubElement(root, "ModelVariables")
    # FMI 3 names variables by value reference; these count from 1 along the list, because
    # OMSimulator takes those in ModelStructure for positions there
    reference_of = {entry.name: place for place, entry in enumerate(listed, 1)}
    for entry in listed:
        reference = reference_of[entry.name]
        attributes = _attributes(
            name=entry.name,
            valueReference=reference,
            description=entry.quantity.text,
            causality=_CAUSALITY[entry.part],
            variability=_variability(entry),
            initial=_initial(entry),
            intermediateUpdate=True if entry.part == "input" else None,
        )
        if entry.name == "solver.method":
            attributes |= _attributes(
                declaredType="SolverMethod", min=1, max=len(METHODS), start=int(entry.start)
            )
            ET.SubElement(variables, "Enumeration", attributes)
            continue
        attributes |= _value_attributes(entry)
        if entry.part == "derivative":
            attributes["derivative"] = str(reference_of[entry.name[4:-1]])
        ET.SubElement(variables, "Float64", attributes)
    structure = ET.SubElement(root, "ModelStructure")
    # the time is a known like any other in FMI 3: a list without it says that nothing depends on it
    known = {e.name: reference_of[e.name] for e in listed if e.part in ("time", "state", "input")}
    for part, tag in (("output", "Output"), ("derivative", "ContinuousStateDerivative")):
        for entry in listed:
            if entry.part == part:
                dependencies = _dependencies(entry, functions, known)
                ET.SubElement(
                    structure,
                    tag,
                    _attributes(
                        valueReference=reference_of[entry.name],
                        dependencies=" ".join(map(str, dependencies)),
                    ),
                )
    for entry in listed:
        if entry.part in ("output", "derivative"):
            reference = reference_of[entry.name]
            ET.SubElement(structure, "InitialUnknown", _attributes(valueReference=reference))
    return _serialize(root)


def terminals(model: Model) -> bytes | None:
    """terminalsAndIcons.xml (FMI 3): one terminal per port, None without ports."""
    if not model.ports:
        return None
    root = ET.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    holder = ET.SubElement(root, "Terminals")
    for port, name in model.ports:
        terminal = ET.SubElement(
            holder, "Terminal", _attributes(name=name, matchingRule="plug", description=port.text)
        )
        for member, quantity in (("effort", port.effort), ("flow", port.flow)):
            for index, variable in enumerate(quantity.names()):
                suffix = f"[{index + 1}]" if quantity.size else ""
                ET.SubElement(
                    terminal,
                    "TerminalMemberVariable",
                    _attributes(
                        variableName=variable, memberName=member + suffix, variableKind="signal"
                    ),
                )
    return _serialize(root)


def build_description(identifier: str) -> bytes:
    """sources/buildDescription.xml (FMI 3): how to compile the C sources."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    sources = ET.SubElement(configuration, "SourceFileSet", language="C99")
    for name in SOURCE_FILES:
        ET.SubElement(sources, "SourceFile", name=name)
    return _serialize(root)


def _source_files(parent: ET.Element) -> None:
    holder = ET.SubElement(parent, "SourceFiles")
    for name in SOURCE_FILES:
        ET.SubElement(holder, "File", name=name)


def _serialize(root: ET.Element) -> bytes:
    ET.indent(root)
    text: str = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()
