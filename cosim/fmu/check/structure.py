"""Rules for ModelStructure: who depends on whom, and that nobody is missing."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable

from .finding import Findings
from .model import Declared, Model

_KINDS = ("dependent", "constant", "fixed", "tunable", "discrete")
_SHOWN = 8
"""Names that a finding lists."""


def check_structure(model: Model, findings: Findings) -> None:
    """Check the lists of outputs, derivatives and initial unknowns against the variables."""
    structure = model.root.find("ModelStructure")
    if structure is None:
        findings.error(
            "ModelStructure is missing", "list the outputs there", model.line(model.root)
        )
        return
    line = model.line(structure)
    if model.fmi == 2:
        places = {
            "Outputs": "Outputs/Unknown",
            "Derivatives": "Derivatives/Unknown",
            "InitialUnknowns": "InitialUnknowns/Unknown",
        }
    else:
        places = {
            "Outputs": "Output",
            "Derivatives": "ContinuousStateDerivative",
            "InitialUnknowns": "InitialUnknown",
            "clocked states": "ClockedState",
            "event indicators": "EventIndicator",
        }
    listed = {
        name: _unknowns(model, structure.iterfind(place), name, findings)
        for name, place in places.items()
    }
    _compare(
        "Outputs", 'causality="output"',
        [v for v in model.variables if v.causality == "output"], listed["Outputs"], line, findings,
    )  # fmt: skip
    _derivatives(model, listed["Derivatives"], line, findings)
    _compare(
        "InitialUnknowns", "a value that is computed at initialization",
        _initial(model, listed["Derivatives"]), _unclocked(listed["InitialUnknowns"]), line,
        findings,
    )  # fmt: skip


def _unclocked(variables: list[Declared]) -> list[Declared]:
    """Clocked variables may be initial unknowns, or not."""
    return [variable for variable in variables if not variable.clocked]


def _unknowns(
    model: Model, elements: Iterable[ET.Element], name: str, findings: Findings
) -> list[Declared]:
    found: dict[Declared, None] = {}
    for element in elements:
        text, line = element.get(model.reference_name, ""), model.line(element)
        variable = model.refers(text)
        _dependencies(model, element, name, findings)
        if variable is None:
            findings.error(
                f"{name} list {model.reference_name} {text!r}, which no variable has",
                "correct the reference", line,
            )  # fmt: skip
        elif variable in found:
            findings.error(f"{name} list it twice", "list it once", line, variable.name)
        else:
            found[variable] = None
    return list(found)


def _dependencies(model: Model, element: ET.Element, name: str, findings: Findings) -> None:
    line = model.line(element)
    text, kinds = element.get("dependencies"), element.get("dependenciesKind")
    known = (text or "").split()
    for item in known:
        if model.refers(item) is None:
            findings.error(
                f"{name} depend on {model.reference_name} {item!r}, which no variable has",
                "correct dependencies", line,
            )  # fmt: skip
    if len(set(known)) < len(known):
        findings.warning(f"{name} name a dependency twice", "name each once", line)
    if kinds is None:
        return
    if text is None:
        findings.error(
            f"{name} have dependenciesKind without dependencies", "give both or none", line
        )
    elif len(kinds.split()) != len(known):
        findings.error(
            f"{name} have {len(known)} dependencies and {len(kinds.split())} kinds",
            "give one kind each", line,
        )  # fmt: skip
    unknown = [kind for kind in kinds.split() if kind not in _KINDS]
    if unknown:
        findings.error(
            f"{name} have the unknown dependenciesKind {unknown[0]!r}",
            f"it is one of {', '.join(_KINDS)}", line,
        )  # fmt: skip
    elif name == "InitialUnknowns" and set(kinds.split()) - {"dependent", "constant"}:
        findings.error(
            "InitialUnknowns have a dependenciesKind other than dependent and constant",
            "fixed, tunable and discrete have no meaning at initialization", line,
        )  # fmt: skip


def _derivatives(model: Model, listed: list[Declared], line: int, findings: Findings) -> None:
    for variable in listed:
        if variable.inner.get("derivative") is None:
            findings.error(
                "is listed in Derivatives, but has no attribute derivative",
                "name its state there", variable.line, variable.name,
            )  # fmt: skip
    known = set(listed)
    missing = [
        variable
        for variable in model.variables
        if variable.inner.get("derivative") is not None and variable not in known
    ]
    if not missing:
        return
    text = f"Derivatives lack {_names(missing)}, which have the attribute derivative"
    way_out = "list them, or leave the attribute out"
    if model.root.find("ModelExchange") is not None:
        findings.error(text, way_out, line)
    else:
        findings.warning(text, way_out, line)


def _initial(model: Model, derivatives: list[Declared]) -> list[Declared]:
    """The variables that InitialUnknowns have to list (FMI 2.0.4, 2.2.8; FMI 3.0, 2.4.8)."""
    found = []
    states = {model.refers(v.inner.get("derivative", "")) for v in derivatives}
    states |= set(derivatives)
    computed = ("approx", "calculated")
    for variable in model.variables:
        wanted = (
            variable.causality == "calculatedParameter"
            or (variable.causality == "output" and variable.initial in computed)
            or (variable in states and variable.initial in computed)
        )
        if wanted and not variable.clocked:
            found.append(variable)
    return found


def _compare(
    name: str, what: str, wanted: list[Declared], listed: list[Declared], line: int,
    findings: Findings,
) -> None:  # fmt: skip
    have, need = set(listed), set(wanted)
    missing = [variable for variable in wanted if variable not in have]
    extra = [variable for variable in listed if variable not in need]
    if missing:
        findings.error(f"{name} lack {_names(missing)}", f"list each variable with {what}", line)
    if extra:
        findings.error(f"{name} list {_names(extra)}", f"list variables with {what} only", line)


def _names(variables: list[Declared]) -> str:
    shown = ", ".join(repr(variable.name) for variable in variables[:_SHOWN])
    rest = len(variables) - _SHOWN
    return shown + (f" and {rest} more" if rest > 0 else "")
