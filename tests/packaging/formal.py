"""What the FMI standards demand of a model description, stated apart from what writes ours.

`problems(root)` lists what breaks a rule. Sources: FMI 2.0.4, sections 2.2.1 to 2.2.10, 3.3, 4.3;
FMI 3.0.2, sections 2.4 and 2.2.10. Schemas are not repeated here: they are checked beside it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from xml.etree import ElementTree as ET

ALLOWED = {
    "parameter": {"fixed", "tunable"},
    "calculatedParameter": {"fixed", "tunable"},
    "input": {"discrete", "continuous"},
    "output": {"constant", "discrete", "continuous"},
    "local": {"constant", "fixed", "tunable", "discrete", "continuous"},
    "independent": {"continuous"},
}
"""Variabilities of each causality."""

INITIAL = {
    ("parameter", "fixed"): {"exact"},
    ("parameter", "tunable"): {"exact"},
    ("calculatedParameter", "fixed"): {"calculated", "approx"},
    ("calculatedParameter", "tunable"): {"calculated", "approx"},
    ("input", "discrete"): {None},
    ("input", "continuous"): {None},
    ("output", "constant"): {"exact"},
    ("output", "discrete"): {"exact", "approx", "calculated"},
    ("output", "continuous"): {"exact", "approx", "calculated"},
    ("local", "constant"): {"exact"},
    ("local", "fixed"): {"calculated", "approx"},
    ("local", "tunable"): {"calculated", "approx"},
    ("local", "discrete"): {"exact", "approx", "calculated"},
    ("local", "continuous"): {"exact", "approx", "calculated"},
    ("independent", "continuous"): {None},
}
"""Values of `initial` for each causality and variability; None: the attribute must be absent."""

_PART = r"[A-Za-z_]\w*(\[\d+(,\d+)*\])?"
_NAME = re.compile(rf"({_PART}(\.{_PART})*|der\({_PART}(\.{_PART})*(,[1-9]\d*)?\))", re.ASCII)
BASE = {"kg", "m", "s", "A", "K", "mol", "cd", "rad", "factor", "offset"}


@dataclass(frozen=True)
class Variable:
    """One variable in the form that both versions share; `key` is how others refer to it."""

    key: str
    type: str
    attributes: dict[str, str]

    def __getattr__(self, name: str) -> str | None:
        return self.attributes.get(name)


def variables(root: ET.Element) -> list[Variable]:
    """All variables; keys are 1-based positions in FMI 2 and value references in FMI 3."""
    found = []
    for place, element in enumerate(root.findall("ModelVariables/*"), 1):
        if two(root):
            typed = element[0]
            attributes = {"causality": "local", "variability": "continuous"}
            found.append(
                Variable(str(place), typed.tag, attributes | element.attrib | typed.attrib)
            )
        else:
            default = "continuous" if element.tag.startswith("Float") else "discrete"
            attributes = {"causality": "local", "variability": default}
            found.append(
                Variable(element.attrib["valueReference"], element.tag, attributes | element.attrib)
            )
    return found


def two(root: ET.Element) -> bool:
    """Whether this is FMI 2."""
    return root.attrib["fmiVersion"].startswith("2")


def problems(root: ET.Element) -> list[str]:
    """What breaks a rule, in words that name the variable."""
    listed = variables(root)
    return [
        *_head(root),
        *_single(listed),
        *_names(root, listed),
        *_references(listed),
        *_units(root, listed),
        *_types(root, listed),
        *_derivatives(listed),
        *_structure(root, listed),
    ]


def _head(root: ET.Element) -> Iterator[str]:
    token = "guid" if two(root) else "instantiationToken"
    if not root.get(token):
        yield f"{token} is missing"
    for interface in ("ModelExchange", "CoSimulation"):
        element = root.find(interface)
        if element is None:
            continue
        identifier = element.get("modelIdentifier", "")
        if not re.fullmatch(r"[A-Za-z_]\w*", identifier, re.ASCII):
            yield f"{interface}: modelIdentifier {identifier!r} is no C identifier"
        saved, serialized = (
            ("canGetAndSetFMUstate", "canSerializeFMUstate")
            if two(root)
            else ("canGetAndSetFMUState", "canSerializeFMUState")
        )
        if element.get(serialized) == "true" and element.get(saved) != "true":
            yield f"{interface}: states that cannot be got cannot be serialized"
    experiment = root.find("DefaultExperiment")
    if experiment is not None:
        start, stop = (float(experiment.get(f"{which}Time", "nan")) for which in ("start", "stop"))
        step = float(experiment.get("stepSize", "nan"))
        if stop <= start or step <= 0 or step > stop - start:
            yield f"DefaultExperiment: {start}, {stop}, {step}"
    categories = [e.attrib["name"] for e in root.findall("LogCategories/Category")]
    if len(set(categories)) != len(categories):
        yield "a log category is named twice"


def _single(listed: list[Variable]) -> Iterator[str]:
    if sum(v.causality == "independent" for v in listed) > 1:
        yield "more than one independent variable"
    for v in listed:
        causality, variability = str(v.causality), str(v.variability)
        if variability not in ALLOWED.get(causality, set()):
            yield f"{v.name}: {causality} cannot be {variability}"
            continue
        if variability == "continuous" and v.type not in ("Real", "Float64", "Float32"):
            yield f"{v.name}: {v.type} cannot be continuous"
        allowed = INITIAL[causality, variability]
        initial = v.initial
        if initial is None and allowed != {None}:
            initial = "exact" if causality == "parameter" else "calculated"
        if initial not in allowed:
            yield f"{v.name}: initial={initial} for {causality}, {variability}"
        wanted = initial in ("exact", "approx") or causality == "input" or variability == "constant"
        if wanted and v.start is None:
            yield f"{v.name}: no start value"
        if v.start is not None and not wanted:
            yield f"{v.name}: a start value for initial={initial}, {causality}"
        yield from _bounds(v)


def _bounds(v: Variable) -> Iterator[str]:
    low, high = float(v.min or "-inf"), float(v.max or "inf")
    if low > high:
        yield f"{v.name}: min {low} > max {high}"
    if v.start is not None and not low <= float(v.start) <= high:
        yield f"{v.name}: start {v.start} outside [{low}, {high}]"
    nominal = float(v.nominal or "1")
    if not (math.isfinite(nominal) and nominal > 0):
        yield f"{v.name}: nominal {nominal}"
    if v.causality == "independent" and {"start", "min", "max", "nominal"} & set(v.attributes):
        yield f"{v.name}: the independent variable has a value or bounds"


def _names(root: ET.Element, listed: list[Variable]) -> Iterator[str]:
    names = [str(v.name) for v in listed]
    if len(set(names)) != len(names):
        yield "a name stands twice"
    if root.get("variableNamingConvention") == "structured":
        yield from (f"{name}: not a structured name" for name in names if not _NAME.fullmatch(name))
    for text in (v.description or "" for v in listed):
        if re.search(r"[\r\n\t]", text):
            yield f"{text!r} is no normalized string"


def _references(listed: list[Variable]) -> Iterator[str]:
    """Aliases would need equal units, types and at most one settable member; we have none."""
    references = [v.valueReference for v in listed]
    if len(set(references)) != len(references):
        yield "a value reference stands twice"


def _units(root: ET.Element, listed: list[Variable]) -> Iterator[str]:
    defined = {}
    for unit in root.findall("UnitDefinitions/Unit"):
        name = unit.attrib["name"]
        if name in defined:
            yield f"unit {name} is defined twice"
        base = unit.find("BaseUnit")
        defined[name] = dict(base.attrib) if base is not None else {}
        if set(defined[name]) - BASE:
            yield f"unit {name}: {sorted(set(defined[name]) - BASE)}"
        if float(defined[name].get("factor", 1)) == 0:
            yield f"unit {name}: factor 0"
    for v in listed:
        if v.unit is not None and v.unit not in defined:
            yield f"{v.name}: unit {v.unit} is not defined"
        if v.displayUnit is not None:
            shown = root.find(f"UnitDefinitions/Unit[@name='{v.unit}']")
            displayed = (
                [] if shown is None else [e.get("name") for e in shown.findall("DisplayUnit")]
            )
            if v.displayUnit not in displayed:
                yield f"{v.name}: display unit {v.displayUnit} is not defined for {v.unit}"


def _types(root: ET.Element, listed: list[Variable]) -> Iterator[str]:
    declared = {}
    for element in root.findall("TypeDefinitions/*"):
        name = element.attrib["name"]
        if name in declared or name in {v.name for v in listed}:
            yield f"type {name} is not unique"
        holder = element[0] if two(root) else element
        declared[name] = (holder.tag.removesuffix("Type"), holder)
    for v in listed:
        if v.declaredType is None:
            if v.type == "Enumeration":
                yield f"{v.name}: an enumeration without its type"
            continue
        kind, holder = declared.get(v.declaredType, ("", None))
        if holder is None or kind != v.type:
            yield f"{v.name}: {v.declaredType} is no type for {v.type}"
            continue
        items = [item.attrib["value"] for item in holder.findall("Item")]
        if v.type == "Enumeration" and (v.start not in items or len(set(items)) != len(items)):
            yield f"{v.name}: start {v.start} is no item of {v.declaredType}"


def _derivatives(listed: list[Variable]) -> Iterator[str]:
    by_key = {v.key: v for v in listed}
    for v in listed:
        if v.derivative is None:
            continue
        state = by_key.get(v.derivative)
        if state is None:
            yield f"{v.name}: derivative of {v.derivative}, which is not listed"
        elif state.variability != "continuous" or state.causality not in ("local", "output"):
            yield f"{v.name}: {state.name} cannot be a continuous state"
        elif v.variability != "continuous":
            yield f"{v.name}: a derivative is continuous"


def _structure(root: ET.Element, listed: list[Variable]) -> Iterator[str]:
    by_key = {v.key: v for v in listed}
    states = {v.derivative for v in listed if v.derivative}
    known = {v.key for v in listed if v.causality in ("input", "independent")} | states
    if two(root):
        places = {
            "outputs": "ModelStructure/Outputs/Unknown",
            "derivatives": "ModelStructure/Derivatives/Unknown",
            "initial unknowns": "ModelStructure/InitialUnknowns/Unknown",
        }
        attribute = "index"
    else:
        places = {
            "outputs": "ModelStructure/Output",
            "derivatives": "ModelStructure/ContinuousStateDerivative",
            "initial unknowns": "ModelStructure/InitialUnknown",
        }
        attribute = "valueReference"
    calculated = {
        v.key for v in listed if v.initial in ("calculated", "approx", None) and not v.start
    }
    wanted = {
        "outputs": {v.key for v in listed if v.causality == "output"},
        "derivatives": {v.key for v in listed if v.derivative},
    }
    wanted["initial unknowns"] = {
        v.key
        for v in listed
        if v.key in calculated
        and (v.causality in ("output", "calculatedParameter") or v.key in states or v.derivative)
    }
    for title, path in places.items():
        elements = root.findall(path)
        keys = [element.attrib[attribute] for element in elements]
        if len(set(keys)) != len(keys):
            yield f"{title}: one stands twice"
        for key in sorted(wanted[title] ^ set(keys)):
            name = by_key[key].name if key in by_key else key
            yield f"{title}: {name} is {'missing' if key in wanted[title] else 'out of place'}"
        for element in elements:
            yield from _dependencies(title, element, known, by_key)
    order = [e.attrib[attribute] for e in root.findall(places["initial unknowns"])]
    if two(root) and order != sorted(order, key=int):
        yield "initial unknowns: not in order"


def _dependencies(
    title: str, element: ET.Element, known: set[str], by_key: dict[str, Variable]
) -> Iterator[str]:
    given, kinds = element.get("dependencies"), element.get("dependenciesKind")
    if given is None:
        if kinds is not None:
            yield f"{title}: kinds of dependencies without dependencies"
        return
    items = given.split()
    if len(set(items)) != len(items):
        yield f"{title}: a dependency stands twice"
    if kinds is not None and len(kinds.split()) != len(items):
        yield f"{title}: {len(items)} dependencies, {len(kinds.split())} kinds"
    if title == "initial unknowns":
        known = known | {key for key, v in by_key.items() if v.initial == "exact"}
    for item in items:
        if item not in known:
            name = by_key[item].name if item in by_key else item
            yield f"{title}: {name} is nothing that one may depend on"
