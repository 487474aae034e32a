"""Formal rules of FMI 2 and 3 on every variant under test, and seen to catch what breaks them."""

from __future__ import annotations

import copy
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree as ET

import fmpy
import numpy as np
import pytest
from lxml import etree

from sources.packaging.build import Variant
from sources.packaging.description import (
    build_description,
    terminals,
)
from tests.fmus import catalogue
from tests.packaging.described import described
from tests.packaging.formal import ALLOWED, INITIAL, problems, variables

pytestmark = pytest.mark.slow

SCHEMAS = Path(fmpy.__file__).parent / "schema"
TWIN = "dc_motor/sampled"  # inputs, outputs, states, clocks, parameters of both kinds, a solver


@lru_cache(maxsize=2)
def schema(file: str) -> etree.XMLSchema:
    return etree.XMLSchema(etree.parse(str(SCHEMAS / file)))


@pytest.mark.parametrize("name", catalogue())
def test_descriptions_keep_the_rules(name: str) -> None:
    variant, texts = described(name)
    for version, text in texts.items():
        assert problems(ET.fromstring(text)) == [], version
        file = "fmi3/fmi3ModelDescription.xsd" if version == "fmi3" else FMI2
        schema(file).assertValid(etree.fromstring(text))
    _dependencies_are_complete(variant, ET.fromstring(texts["fmi3"]))


FMI2 = "fmi2/fmi2ModelDescription.xsd"


def _dependencies_are_complete(variant: Variant, root: ET.Element) -> None:
    """What is not listed as a dependency has no influence, at a random point."""
    model, functions = variant.model, variant.functions
    roles = [model.of_role(role) for role in ("state", "discrete", "input", "parameter")]
    rng = np.random.default_rng(0)
    point = [np.array([0.37])]
    for role in roles:
        point.append(np.array([v.start + 0.1 * (v.quantity.nominal or 1.0) for v in role]))
    point[3] = point[3] + 0.01 * rng.normal(size=point[3].size)
    names = {v.key: str(v.name) for v in variables(root)}
    rows = {f"der({v.name})": ("x", k) for k, v in enumerate(roles[0])}
    rows |= {v.name: ("y", k) for k, v in enumerate(model.of_role("output"))}
    listed = {
        names[e.attrib["valueReference"]]: {names[d] for d in e.attrib["dependencies"].split()}
        for tag in ("Output", "ContinuousStateDerivative")
        for e in root.findall(f"ModelStructure/{tag}")
    }
    assert set(listed) == set(rows)
    knowns = [("time", 0, 0)]
    knowns += [(v.name, 1, k) for k, v in enumerate(roles[0])]
    knowns += [(v.name, 3, k) for k, v in enumerate(roles[2])]
    for known, place, k in knowns:
        seeds = [np.zeros(item.size) for item in point]
        seeds[place][k] = 1.0
        dx, dy = (np.asarray(r).ravel() for r in functions.directional(*point, *seeds))
        for name, (which, row) in rows.items():
            influence = (dx if which == "x" else dy)[row]
            assert known in listed[name] or influence == 0 or np.isnan(influence), (name, known)


@pytest.mark.parametrize("name", [TWIN, "ur5_arm/rigid", "inertia/disc"])
def test_other_files_keep_their_schemas(name: str) -> None:
    variant, _ = described(name)
    ports = terminals(variant.model)
    assert ports is not None
    schema("fmi3/fmi3TerminalsAndIcons.xsd").assertValid(etree.fromstring(ports))
    text = build_description(variant.name.identifier)
    schema("fmi3/fmi3BuildDescription.xsd").assertValid(etree.fromstring(text))


def test_the_tables_are_whole() -> None:
    pairs = {(causality, v) for causality, allowed in ALLOWED.items() for v in allowed}
    assert pairs == set(INITIAL)


Change = Callable[[ET.Element], object]


def _variable(root: ET.Element, **wanted: str) -> ET.Element:
    for element in root.findall("ModelVariables/*"):
        values = {**element.attrib, **(element[0].attrib if len(element) else {})}
        if all(values.get(name) == value for name, value in wanted.items()):
            return element
    raise LookupError(wanted)


def _typed(root: ET.Element, **wanted: str) -> ET.Element:
    element = _variable(root, **wanted)
    return element[0] if len(element) else element


def _unlisted(root: ET.Element, *tags: str) -> None:
    for tag in tags:
        holder = root.find(f"ModelStructure/{tag}")
        if holder is None:
            continue
        if len(holder):
            holder.remove(holder[0])
        else:
            root.find("ModelStructure").remove(holder)  # type: ignore[union-attr]


BROKEN: dict[str, tuple[Change, str]] = {
    "tunable input": (
        lambda r: _variable(r, causality="input").set("variability", "tunable"),
        "input cannot be tunable",
    ),
    "exact input": (
        lambda r: _variable(r, causality="input").set("initial", "exact"),
        "initial=exact for input",
    ),
    "calculated parameter": (
        lambda r: _variable(r, causality="parameter").set("initial", "calculated"),
        "initial=calculated for parameter",
    ),
    "input without start": (
        lambda r: _typed(r, causality="input").attrib.pop("start"),
        "no start value",
    ),
    "output with start": (
        lambda r: _typed(r, causality="output").set("start", "1.0"),
        "a start value for initial=calculated",
    ),
    "start below": (
        lambda r: _typed(r, causality="input").set("min", "1e9"),
        "outside [1000000000.0, inf]",
    ),
    "nominal": (lambda r: _typed(r, causality="input").set("nominal", "0"), "nominal 0.0"),
    "name": (
        lambda r: _variable(r, causality="input").set("name", "1 bad-name"),
        "1 bad-name: not a structured name",
    ),
    "alias": (
        lambda r: _variable(r, causality="input").set("valueReference", "1"),
        "a value reference stands twice",
    ),
    "unit": (lambda r: _typed(r, causality="input").set("unit", "furlong"), "furlong is not def"),
    "display unit": (
        lambda r: _typed(r, causality="input").set("displayUnit", "deg"),
        "display unit deg is not defined",
    ),
    "enumeration": (
        lambda r: _typed(r, declaredType="SolverMethod").set("start", "9"),
        "is no item of SolverMethod",
    ),
    "type": (
        lambda r: _typed(r, declaredType="SolverMethod").set("declaredType", "Nothing"),
        "Nothing is no type for Enumeration",
    ),
    "output not listed": (lambda r: _unlisted(r, "Outputs", "Output"), "outputs: "),
    "derivative not listed": (
        lambda r: _unlisted(r, "Derivatives", "ContinuousStateDerivative"),
        "derivatives: ",
    ),
    "initial unknown": (
        lambda r: _unlisted(r, "InitialUnknowns", "InitialUnknown"),
        "initial unknowns: ",
    ),
    "experiment": (
        lambda r: r.find("DefaultExperiment").set("stepSize", "-1"),  # type: ignore[union-attr]
        "DefaultExperiment",
    ),
    "identifier": (
        lambda r: r.find("CoSimulation").set("modelIdentifier", "a b"),  # type: ignore[union-attr]
        "no C identifier",
    ),
    "serialized": (
        lambda r: [r.find("CoSimulation").attrib.pop(f"canGetAndSetFMU{s}tate", 0) for s in "sS"],  # type: ignore[union-attr]
        "cannot be serialized",
    ),
}


@pytest.mark.parametrize("version", ["fmi2", "fmi3"])
@pytest.mark.parametrize("case", BROKEN)
def test_what_breaks_a_rule_is_found(case: str, version: str) -> None:
    change, words = BROKEN[case]
    root = copy.deepcopy(ET.fromstring(described(TWIN)[1][version]))
    change(root)
    found = problems(root)
    assert any(words in problem for problem in found), found


def test_time_is_a_dependency_where_fmi_3_lists_it() -> None:
    _, texts = described("trajectory/world")
    root = ET.fromstring(texts["fmi3"])
    (time,) = (v.key for v in variables(root) if v.causality == "independent")
    listed = [e.attrib["dependencies"].split() for e in root.findall("ModelStructure/Output")]
    assert any(time in items for items in listed)
