"""Rules for single variables: names, combinations, start values, bounds, references."""

from __future__ import annotations

import math
import re

from ...reading.limits import VALUES
from .finding import Findings
from .model import FLOATS, RANGES, Declared, Model

_B = (
    r"(?:[A-Za-z_][A-Za-z_0-9]*"
    r"|'(?:[A-Za-z_0-9!#$%&()*+,\-./:;<>=?@\[\]^{}|~ ]|\\['\"?\\abfnrtv])+')"
)
_IDENTIFIER = rf"{_B}(?:\[\d+(?:,\d+)*\])?(?:\.{_B}(?:\[\d+(?:,\d+)*\])?)*"
_STRUCTURED = re.compile(rf"{_IDENTIFIER}|der\({_IDENTIFIER}(?:,\d+)?\)")
"""Names of `variableNamingConvention="structured"` (FMI 2.0.4, 2.2.9; FMI 3.0, 2.4.7.5)."""
COMBINATIONS = {
    "structuralParameter": ("fixed", "tunable"),
    "parameter": ("fixed", "tunable"),
    "calculatedParameter": ("fixed", "tunable"),
    "input": ("discrete", "continuous"),
    "output": ("constant", "discrete", "continuous"),
    "local": ("constant", "fixed", "tunable", "discrete", "continuous"),
    "independent": ("continuous",),
}
"""Variabilities by causality (FMI 2.0.4, table on page 49; FMI 3.0, 2.4.7.4)."""
_CALCULATED = ("calculated", "approx")
_LONGEST = 60
"""Characters of a value that are shown."""


def check_variables(model: Model, findings: Findings) -> None:
    """Check every variable by itself, and names and references against each other."""
    _names(model, findings)
    _references(model, findings)
    for variable in model.variables:
        _combination(variable, findings)
        _size(model, variable, findings)
        _numbers(model, variable, findings)
        _refers(model, variable, findings)
    independent = [v for v in model.variables if v.causality == "independent"]
    if model.fmi == 3 and not independent:
        findings.error(
            "has no independent variable", 'declare one with causality="independent" (time)'
        )
    for variable in independent[1:]:
        findings.error(
            f"is a second independent variable beside {independent[0].name!r}",
            "declare one", variable.line, variable.name,
        )  # fmt: skip


def _names(model: Model, findings: Findings) -> None:
    flat = model.root.get("variableNamingConvention", "flat") == "flat"
    first: dict[str, int] = {}
    for variable in model.variables:
        aliases = [item.get("name", "") for item in variable.outer.iterfind("Alias")]
        for name in (variable.name, *aliases):
            if name in first:
                findings.error(
                    f"has the name of a variable in line {first[name]}",
                    "give each variable a name of its own", variable.line, name,
                )  # fmt: skip
            first.setdefault(name, variable.line)
        if not variable.name:
            findings.error("a variable has no name", "give it one", variable.line)
        elif flat and re.search(r"[\r\n\t]", variable.name):
            findings.error(
                "has a tab or a line break in its name", "take it out", variable.line, variable.name
            )
        elif not flat and _STRUCTURED.fullmatch(variable.name) is None:
            findings.error(
                "has no name of the naming convention structured (a.b[1].c, der(x), 'quoted')",
                'rename it, or declare variableNamingConvention="flat"', variable.line,
                variable.name,
            )  # fmt: skip


def _references(model: Model, findings: Findings) -> None:
    """Value references: 32 bits; FMI 3 one per variable, FMI 2 one per set of aliases."""
    first: dict[tuple[str, str], Declared] = {}
    for variable in model.variables:
        text = variable.reference
        if not (text.isascii() and text.isdigit() and len(text) < 20 and int(text) < 2**32):
            findings.error(
                f"has the value reference {text[:_LONGEST]!r}, not a whole number of 32 bits",
                "number variables from 0 to 4294967295", variable.line, variable.name,
            )  # fmt: skip
            continue
        base = "Integer" if variable.type == "Enumeration" else variable.type
        key = (str(int(text)), base if model.fmi == 2 else "")
        other = first.setdefault(key, variable)
        if other is variable:
            continue
        if model.fmi == 3:
            findings.error(
                f"has the value reference {text} of {other.name!r} (line {other.line})",
                "give it one of its own, or declare it as <Alias>", variable.line, variable.name,
            )  # fmt: skip
        elif variable.start is not None and other.start is not None and (
            "constant" not in (variable.variability, other.variability)
        ):  # fmt: skip
            findings.error(
                f"is an alias of {other.name!r} (line {other.line}), and both have start values",
                "leave one", variable.line, variable.name,
            )  # fmt: skip
        elif {"input", "parameter"} >= {variable.causality, other.causality}:
            findings.error(
                f"is an alias of {other.name!r} (line {other.line}), and both are set from outside",
                "give them value references of their own", variable.line, variable.name,
            )  # fmt: skip


def _combination(variable: Declared, findings: Findings) -> None:
    causality, variability = variable.causality, variable.variability
    where = (variable.line, variable.name)
    allowed = COMBINATIONS.get(causality)
    if allowed is None or (causality == "structuralParameter" and variable.fmi == 2):
        findings.error(f"has the unknown causality {causality!r}", _one_of(COMBINATIONS), *where)
        return
    if variable.type not in FLOATS and variability == "continuous":
        findings.error(
            f"is of type {variable.type} and has variability continuous",
            'declare variability="discrete" (or "fixed" for a parameter)', *where,
        )  # fmt: skip
    elif variability not in allowed:
        findings.error(
            f"has causality {causality} and variability {variability}, which do not go together",
            f"with {causality} the variability is {' or '.join(allowed)}", *where,
        )  # fmt: skip
        return
    given = variable.outer.get("initial")
    if given is not None and (
        causality == "independent" or (causality == "input" and variable.fmi == 2)
    ):
        findings.error(
            f"has causality {causality} and initial={given!r}", "leave initial out", *where
        )
    elif given is not None and given not in _initials(causality, variability):
        findings.error(
            f"has causality {causality}, variability {variability} and initial {given}, which do "
            "not go together", f"initial is {' or '.join(_initials(causality, variability))}",
            *where,
        )  # fmt: skip
    elif variable.type != "Clock":
        _has_start(variable, findings)
    declared = variable.fmi == 3 and variable.outer.get("intermediateUpdate") in ("true", "1")
    if declared and variability != "continuous":
        findings.error(
            f"has intermediateUpdate and variability {variability}: only what is continuous may "
            "change within a step", "leave intermediateUpdate out", *where,
        )  # fmt: skip


def _one_of(names: object) -> str:
    return f"it is one of {', '.join(map(str, names))}"  # type: ignore[call-overload]


def _initials(causality: str, variability: str) -> tuple[str, ...]:
    exact = ("parameter", "structuralParameter", "input")  # an input: FMI 3 only
    if causality in exact or variability == "constant":
        return ("exact",)
    if causality == "calculatedParameter" or variability in ("fixed", "tunable"):
        return _CALCULATED
    return ("exact", *_CALCULATED)


def _has_start(variable: Declared, findings: Findings) -> None:
    where = (variable.line, variable.name)
    if variable.start is None:
        if variable.initial in ("exact", "approx") or variable.causality == "input":
            what = "an input" if variable.causality == "input" else f"of initial {variable.initial}"
            findings.error(f"is {what} and has no start value", "give it one", *where)
    elif variable.initial == "calculated":
        findings.error(
            "is of initial calculated and has a start value",
            'leave it out, or declare initial="approx" or "exact"', *where,
        )  # fmt: skip
    elif variable.causality == "independent":
        findings.error("is the independent variable and has a start value", "leave it out", *where)


# -- sizes -----------------------------------------------------------------------------------------


def _size(model: Model, variable: Declared, findings: Findings) -> None:
    where = (variable.line, variable.name)
    for dimension in variable.outer.iterfind("Dimension"):
        start, reference = dimension.get("start"), dimension.get("valueReference")
        if (start is None) == (reference is None):
            findings.error(
                "has a dimension with start and valueReference, or neither", "give one", *where
            )
        if reference is not None:
            other = model.refers(reference)
            if other is None or other.type != "UInt64":
                findings.error(
                    f"has a dimension by value reference {reference}, which "
                    + ("no variable has" if other is None else f"is of type {other.type}"),
                    "refer to a structural parameter or constant of type UInt64", *where,
                )  # fmt: skip
            elif other.causality != "structuralParameter" and other.variability != "constant":
                findings.error(
                    f"has a dimension by {other.name!r}, which has causality {other.causality}",
                    "refer to a structural parameter or constant", *where,
                )  # fmt: skip
    if variable.outer.find("Dimension") is None:
        return
    size = size_of(model, variable)
    if size is not None and size < 1:
        findings.error("has a dimension that is not positive", "start with one element", *where)
    elif size is not None and (excess := VALUES.excess(size)):
        findings.error(f"is too large: {excess}", "or declare it smaller", *where)


def size_of(model: Model, variable: Declared) -> int | None:
    """Number of values of a variable at the start, None where it cannot be known."""
    size = 1
    for dimension in variable.outer.iterfind("Dimension"):
        text = dimension.get("start")
        if text is None:
            other = model.refers(dimension.get("valueReference", ""))
            text = other.start if other is not None else None
        number = _whole(text or "")
        if number is None:
            return None
        size *= number
    return size


# -- values ----------------------------------------------------------------------------------------


def _whole(text: str) -> int | None:
    text = text.strip()
    return int(text) if re.fullmatch(r"[+-]?\d{1,20}", text, flags=re.ASCII) else None


def value_of(text: str, type_: str) -> float | bool | None:
    """A number or boolean as XML has it, None if it is none."""
    text = text.strip()
    if type_ == "Boolean":
        return {"true": True, "1": True, "false": False, "0": False}.get(text)
    if type_ in FLOATS:
        if text in ("INF", "+INF", "-INF", "NaN"):
            return float(text.lower())
        if re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", text, flags=re.ASCII) is None:
            return None
        return float(text)
    number = _whole(text)
    low, high = RANGES.get(type_, (0, 0))
    return number if number is not None and low <= number <= high else None


def _limit(variable: Declared, key: str, findings: Findings) -> float | None:
    text = variable.get(key)
    if text is None:
        return None
    value = value_of(text, variable.type)
    if value is None or math.isnan(value):
        findings.error(
            f"has {key} = {text[:_LONGEST]!r}, which is no {variable.type}", "write a number",
            variable.line, variable.name,
        )  # fmt: skip
        return None
    return value


def _numbers(model: Model, variable: Declared, findings: Findings) -> None:
    if variable.type not in FLOATS and variable.type not in (*RANGES, "Boolean"):
        return
    where = (variable.line, variable.name)
    low, high = _limit(variable, "min", findings), _limit(variable, "max", findings)
    if low is not None and high is not None and low > high:
        findings.error(f"has min = {low:.17g} above max = {high:.17g}", "swap them", *where)
        low = high = None
    if variable.type in FLOATS:
        nominal = _limit(variable, "nominal", findings)
        if nominal is not None and not (nominal > 0.0 and math.isfinite(nominal)):
            findings.error(
                f"has nominal = {nominal:g}", "give its usual size, a number above 0", *where
            )
    if variable.start is None:
        return
    texts = variable.start.split()
    size = size_of(model, variable)
    if not texts or (len(texts) != 1 and size is not None and len(texts) != size):
        findings.error(
            f"has {len(texts)} start values for {size} elements", "give one, or one each", *where
        )
    items = _items(variable)
    for text in texts:
        value = value_of(text, variable.type)
        if value is None:
            findings.error(
                f"has start = {text[:_LONGEST]!r}, which is no {variable.type}",
                "write a value of its type", *where,
            )  # fmt: skip
            break
        if isinstance(value, float) and not math.isfinite(value):
            findings.warning(f"has start = {text}", "begin with a finite value", *where)
        elif (low is not None and value < low) or (high is not None and value > high):
            bounds = f"[{_shown(low, '-inf')}, {_shown(high, 'inf')}]"
            findings.error(
                f"has start = {text} outside its bounds {bounds}", "correct start, min or max",
                *where,
            )  # fmt: skip
            break
        elif items and value not in items.values():
            listed = ", ".join(f"{name} = {number}" for name, number in list(items.items())[:12])
            findings.error(
                f"has start = {text}, which is no item of its enumeration",
                f"use one of {listed}", *where,
            )  # fmt: skip
            break


def _shown(value: float | None, open_: str) -> str:
    return open_ if value is None else f"{value:.17g}"


def _items(variable: Declared) -> dict[str, int]:
    if variable.type != "Enumeration" or variable.kind is None:
        return {}
    return {
        item.get("name", ""): number
        for item in variable.kind.iterfind("Item")
        if (number := _whole(item.get("value", ""))) is not None
    }


# -- references ------------------------------------------------------------------------------------


def _refers(model: Model, variable: Declared, findings: Findings) -> None:
    where = (variable.line, variable.name)
    declared = variable.inner.get("declaredType")
    if declared is not None:
        wanted = variable.type if model.fmi == 2 else f"{variable.type}Type"
        if variable.kind is None:
            findings.error(
                f"is of declaredType {declared!r}, which is not defined",
                "define it in TypeDefinitions", *where,
            )  # fmt: skip
        elif variable.kind.tag != wanted:
            findings.error(
                f"is of type {variable.type}, but its declaredType {declared!r} is a "
                f"{variable.kind.tag}", "declare a type of its own kind", *where,
            )  # fmt: skip
    elif variable.type == "Enumeration":
        findings.error("is an enumeration without a declaredType", "name its type", *where)
    derivative = variable.inner.get("derivative")
    if derivative is not None:
        state = model.refers(derivative)
        if state is None:
            findings.error(
                f"is the derivative of {model.reference_name} {derivative}, which no variable has",
                "refer to its state", *where,
            )  # fmt: skip
        elif state is variable or state.type not in FLOATS or state.variability != "continuous":
            findings.error(
                f"is the derivative of {state.name!r} (line {state.line}), which is no continuous "
                "state" if state is not variable else "is the derivative of itself",
                "refer to its state", *where,
            )  # fmt: skip
    for key in ("clocks", "previous"):
        for text in (variable.outer.get(key) or "").split():
            other = model.refers(text)
            if other is None or (key == "clocks" and other.type != "Clock"):
                findings.error(
                    f"has {key} = {text}, which is no {'clock' if key == 'clocks' else 'variable'}",
                    "refer by value reference", *where,
                )  # fmt: skip
