"""Rules for what stands around the variables: versions, interfaces, units, types, experiment."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET

from ..attributes import unit_of
from ..variables import FMI3_TYPES
from .finding import Findings
from .model import RANGES, Model
from .variables import value_of

INTERFACES = ("CoSimulation", "ModelExchange", "ScheduledExecution")
_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z_0-9]*")


def check_definitions(model: Model, findings: Findings) -> None:
    """Check all but variables and model structure."""
    _head(model, findings)
    _interfaces(model, findings)
    units = _units(model, findings)
    _types(model, units, findings)
    _units_of_variables(model, units, findings)
    _experiment(model, findings)
    if model.fmi == 3:
        for element in model.root.iterfind("ModelVariables/*"):
            if element.tag not in FMI3_TYPES:
                findings.error(
                    f"has a variable of the unknown type {element.tag!r}",
                    f"the types are {', '.join(FMI3_TYPES)}", model.line(element),
                )  # fmt: skip


def _head(model: Model, findings: Findings) -> None:
    root, line = model.root, model.line(model.root)
    for key in ("modelName", "guid" if model.fmi == 2 else "instantiationToken"):
        if not root.get(key):
            findings.error(f"{key} is missing", "export it again", line)
    convention = root.get("variableNamingConvention", "flat")
    if convention not in ("flat", "structured"):
        findings.error(
            f"variableNamingConvention is {convention!r}", "it is flat or structured", line
        )
    categories: set[str] = set()
    for item in root.iterfind("LogCategories/Category"):
        name = item.get("name", "")
        if name in categories:
            findings.error(f"has two log categories {name!r}", "name each once", model.line(item))
        categories.add(name)


def _interfaces(model: Model, findings: Findings) -> None:
    present = [item for item in model.root if item.tag in INTERFACES]
    line = model.line(model.root)
    if not present:
        findings.error("has no interface", "export it for co-simulation", line)
    elif not any(item.tag == "CoSimulation" for item in present):
        findings.warning(
            f"has {' and '.join(item.tag for item in present)} only, so it cannot be run here",
            "export it for co-simulation, too", line,
        )  # fmt: skip
    for item in present:
        name, line = item.get("modelIdentifier", ""), model.line(item)
        if _IDENTIFIER.fullmatch(name) is None:
            findings.error(
                f"{item.tag} has modelIdentifier {name!r}, which is no name of C",
                "letters, digits and underscores, beginning with a letter", line,
            )  # fmt: skip
        spelling = "FMUstate" if model.fmi == 2 else "FMUState"
        can, serialize = (
            item.get(f"{verb}{spelling}") in ("true", "1")
            for verb in ("canGetAndSet", "canSerialize")
        )
        if serialize and not can:
            findings.error(
                f"{item.tag} declares canSerialize{spelling} without canGetAndSet{spelling}",
                "declare both or none", line,
            )  # fmt: skip
        early, asks = "canReturnEarlyAfterIntermediateUpdate", "providesIntermediateUpdate"
        if item.get(early) in ("true", "1") and item.get(asks) not in ("true", "1"):
            findings.error(
                f"{item.tag} declares {early} without {asks}", "declare both or none", line
            )


def _units(model: Model, findings: Findings) -> dict[str, set[str]]:
    """Units and their display units, by name."""
    found: dict[str, set[str]] = {}
    for unit in model.root.iterfind("UnitDefinitions/Unit"):
        name, line = unit.get("name", ""), model.line(unit)
        if name in found:
            findings.error(f"unit {name!r} is defined twice", "define it once", line)
        display = found.setdefault(name, set())
        if unit.find("BaseUnit") is None and unit_of(name, {}) is None:
            findings.warning(
                f"unit {name!r} has no BaseUnit, and its name says nothing: values in it are not "
                "converted", "say what it is in SI units", line,
            )  # fmt: skip
        for item in unit.iterfind("DisplayUnit"):
            if item.get("name", "") in display:
                findings.error(
                    f"unit {name!r} has two display units {item.get('name')!r}",
                    "define each once", line,
                )  # fmt: skip
            display.add(item.get("name", ""))
        for item in unit:
            if item.tag not in ("BaseUnit", "DisplayUnit"):
                continue
            factor = value_of(item.get("factor", "1"), "Float64")
            if factor is None or not math.isfinite(factor) or not factor:
                findings.error(
                    f"{item.tag} of unit {name!r} has factor {item.get('factor')!r}",
                    "a unit converts by a number other than 0", model.line(item),
                )  # fmt: skip
    return found


def _unit_of(element: ET.Element, kind: ET.Element | None) -> tuple[str | None, str | None]:
    unit = element.get("unit") or (kind.get("unit") if kind is not None else None)
    display = element.get("displayUnit") or (kind.get("displayUnit") if kind is not None else None)
    return unit, display


def _units_of_variables(model: Model, units: dict[str, set[str]], findings: Findings) -> None:
    for variable in model.variables:
        where = (variable.line, variable.name)
        unit, display = _unit_of(variable.inner, variable.kind)
        if unit is not None and unit not in units:
            findings.error(
                f"has the unit {unit!r}, which is not defined", "define it in UnitDefinitions",
                *where,
            )  # fmt: skip
            continue
        wanted = [display, *(item.get("displayUnit") for item in variable.outer.iterfind("Alias"))]
        for name in filter(None, wanted):
            if unit is None:
                findings.error(
                    f"has the display unit {name!r} and no unit", "give it a unit", *where
                )
            elif name not in units[unit]:
                findings.error(
                    f"has the display unit {name!r}, which unit {unit!r} does not define",
                    f"define it there; there is {', '.join(sorted(units[unit])) or 'none'}", *where,
                )  # fmt: skip


def _types(model: Model, units: dict[str, set[str]], findings: Findings) -> None:
    seen: set[str] = set()
    for outer in model.root.iterfind("TypeDefinitions/*"):
        name, line = outer.get("name", ""), model.line(outer)
        what = f"type {name!r}"
        if name in seen:
            findings.error(f"{what} is defined twice", "define it once", line)
        seen.add(name)
        if any(variable.name == name for variable in model.variables) and model.fmi == 2:
            findings.warning(
                f"{what} has the name of a variable", "FMI asks for names of their own", line
            )
        inner = model.types.get(name)
        if inner is None:
            continue
        unit, _ = _unit_of(inner, None)
        if unit is not None and unit not in units:
            findings.error(
                f"{what} has the unit {unit!r}, which is not defined",
                "define it in UnitDefinitions", line,
            )  # fmt: skip
        kind = inner.tag.removesuffix("Type")
        low, high = (value_of(inner.get(key, ""), kind) for key in ("min", "max"))
        if low is not None and high is not None and low > high:
            findings.error(f"{what} has min = {low} above max = {high}", "swap them", line)
        if kind == "Enumeration":
            _items(what, inner, line, findings)


def _items(what: str, element: ET.Element, line: int, findings: Findings) -> None:
    names: set[str] = set()
    values: set[str] = set()
    for item in element.iterfind("Item"):
        name, value = item.get("name", ""), item.get("value", "").strip()
        number = value_of(value, "Enumeration")
        low, high = RANGES["Enumeration"]
        if number is None or not low <= number <= high:
            findings.error(
                f"{what} has the item {name!r} with the value {value!r}", "number its items", line
            )
        if name in names or value in values:
            findings.error(
                f"{what} has two items {name!r} or two of the value {value}",
                "names and values of items are unique", line,
            )  # fmt: skip
        names.add(name)
        values.add(value)
    if not names:
        findings.error(f"{what} is an enumeration without items", "give it some", line)


def _experiment(model: Model, findings: Findings) -> None:
    element = model.root.find("DefaultExperiment")
    if element is None:
        return
    line = model.line(element)
    found: dict[str, float] = {}
    for key in ("startTime", "stopTime", "stepSize", "tolerance"):
        text = element.get(key)
        if text is None:
            continue
        value = value_of(text, "Float64")
        if value is None or not math.isfinite(value):
            findings.error(f"DefaultExperiment has {key} = {text!r}", "write a number", line)
        else:
            found[key] = value
    for key in ("stepSize", "tolerance"):
        if key in found and not found[key] > 0.0:
            findings.error(
                f"DefaultExperiment has {key} = {found[key]:g}", "it must be positive", line
            )
    start = found.get("startTime", 0.0)
    if "stopTime" in found and not found["stopTime"] >= start:
        findings.error(
            f"DefaultExperiment stops at {found['stopTime']:g} s, before its start at {start:g} s",
            "correct startTime or stopTime", line,
        )  # fmt: skip
