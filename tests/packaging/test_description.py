"""Rules of the FMI standards that schemas and validators do not check, over the whole catalogue."""

from __future__ import annotations

import re
import zipfile
from itertools import chain
from xml.etree import ElementTree as ET

import pytest

from sources.packaging import native
from sources.packaging.build import Variant
from sources.packaging.description import terminals
from sources.packaging.platforms import PLATFORMS
from tests.fmus import catalogue, fmu
from tests.packaging.described import described as texts_of

pytestmark = pytest.mark.slow

NAMES = catalogue()
Exponents = dict[str, int]


Described = tuple[Variant, ET.Element, ET.Element]


def describe(name: str) -> Described:
    variant, texts = texts_of(name)
    return variant, ET.fromstring(texts["fmi2"]), ET.fromstring(texts["fmi3"])


@pytest.fixture(scope="module", params=NAMES)
def described(request: pytest.FixtureRequest) -> Described:
    """One variant after the other goes through all tests, so that it is described once."""
    return describe(request.param)


def variables(root: ET.Element) -> list[dict[str, str]]:
    """Attributes of all variables in one form for both versions, `type` among them."""
    found = []
    for element in root.findall("ModelVariables/*"):
        attributes = {"type": element.tag, **element.attrib}
        if root.get("fmiVersion") == "2.0":
            attributes |= {"type": element[0].tag, **element[0].attrib}
        found.append(attributes)
    return found


def test_both_versions_describe_the_same_variables(described: Described) -> None:
    _, two, three = described
    of_two = {v["name"]: v for v in variables(two)}
    of_three = {v["name"]: v for v in variables(three) if v["causality"] != "independent"}
    assert list(of_two) == list(of_three)
    for key, first in of_two.items():
        second = of_three[key]
        for attribute in ("causality", "variability", "initial", "start", "min"):
            assert first.get(attribute) == second.get(attribute), (key, attribute)
        for attribute in ("max", "nominal", "unit", "description"):
            assert first.get(attribute) == second.get(attribute), (key, attribute)


def test_values_lie_within_bounds_and_nominals_are_positive(described: Described) -> None:
    _, two, _ = described
    for variable in variables(two):
        low, high = float(variable.get("min", "-inf")), float(variable.get("max", "inf"))
        assert low < high, variable["name"]
        if "start" in variable:
            assert low <= float(variable["start"]) <= high, variable["name"]
        assert float(variable.get("nominal", "1")) > 0, variable["name"]


def test_names_are_structured_and_references_unique(described: Described) -> None:
    _, _, three = described
    part = r"[A-Za-z_]\w*(\[\d+\])?"
    grammar = re.compile(rf"(der\({part}(\.{part})*\)|{part}(\.{part})*)", re.ASCII)
    listed = variables(three)
    for variable in listed:
        assert grammar.fullmatch(variable["name"]), variable["name"]
    assert len({v["name"] for v in listed}) == len({v["valueReference"] for v in listed})
    assert len({v["name"] for v in listed}) == len(listed)


def test_references_of_fmi_3_are_positions_in_the_list(described: Described) -> None:
    """OMSimulator takes the value references in ModelStructure for positions, counted from 1."""
    _, _, three = described
    listed = variables(three)
    assert [int(v["valueReference"]) for v in listed] == list(range(1, len(listed) + 1))


def test_derivatives_stand_in_the_order_of_the_states(described: Described) -> None:
    """GetContinuousStates and GetDerivatives know no names: only the order connects them."""
    variant, two, three = described
    states = [v.name for v in variant.model.of_role("state")]
    listed = variables(two)
    derivatives = [
        listed[int(e.attrib["index"]) - 1] for e in two.findall("ModelStructure/Derivatives/*")
    ]
    assert [listed[int(d["derivative"]) - 1]["name"] for d in derivatives] == states
    by_reference = {v["valueReference"]: v for v in variables(three)}
    tag = "ModelStructure/ContinuousStateDerivative"
    derivatives = [by_reference[e.attrib["valueReference"]] for e in three.findall(tag)]
    assert [by_reference[d["derivative"]]["name"] for d in derivatives] == states


def test_initial_unknowns_are_all_that_is_calculated_at_the_start(described: Described) -> None:
    _, two, three = described
    expected = {
        v["name"]
        for v in variables(two)
        if v.get("initial") == "calculated" and (v["causality"] == "output" or "derivative" in v)
    }
    indices = [
        int(e.attrib["index"]) for e in two.findall("ModelStructure/InitialUnknowns/Unknown")
    ]
    assert indices == sorted(set(indices))
    assert {variables(two)[index - 1]["name"] for index in indices} == expected
    by_reference = {v["valueReference"]: v["name"] for v in variables(three)}
    references = [e.attrib["valueReference"] for e in three.findall("*/InitialUnknown")]
    assert sorted(by_reference[r] for r in references) == sorted(expected)


def exponents(root: ET.Element) -> dict[str, tuple[Exponents, float]]:
    found = {}
    for unit in root.findall("UnitDefinitions/Unit"):
        base = dict(unit[0].attrib)
        factor = float(base.pop("factor", "1"))
        found[unit.attrib["name"]] = ({k: int(v) for k, v in base.items()}, factor)
    return found


def test_the_unit_of_a_derivative_is_that_of_its_state_per_second(described: Described) -> None:
    _, two, _ = described
    units, listed = exponents(two), variables(two)
    for variable in listed:
        if "derivative" in variable:
            state, factor = units[listed[int(variable["derivative"]) - 1]["unit"]]
            expected = {**state, "s": state.get("s", 0) - 1}
            expected = {base: power for base, power in expected.items() if power}
            assert units[variable["unit"]] == (expected, factor), variable["name"]


def test_dependencies_are_inputs_states_and_time_only(described: Described) -> None:
    """Known in continuous time; the clocks' values are not: they change in events."""
    variant, two, three = described
    known = {v.name for role in ("state", "input") for v in variant.model.of_role(role)}
    known.add("time")
    listed = variables(two)
    for unknown in two.findall("ModelStructure/*/Unknown"):
        for index in unknown.attrib.get("dependencies", "").split():
            assert listed[int(index) - 1]["name"] in known
    by_reference = {v["valueReference"]: v["name"] for v in variables(three)}
    for unknown in three.findall("ModelStructure/*"):
        for reference in unknown.attrib.get("dependencies", "").split():
            assert by_reference[reference] in known


def test_terminals_name_inputs_and_outputs_once(described: Described) -> None:
    variant, two, _ = described
    content = terminals(variant.model)
    if content is None:
        assert not variant.model.component.ports
        return
    causality = {v["name"]: v["causality"] for v in variables(two)}
    members = [
        element.attrib["variableName"]
        for element in ET.fromstring(content).iter("TerminalMemberVariable")
    ]
    assert {causality[member] for member in members} <= {"input", "output"}
    per_terminal = [
        [element.attrib["memberName"] for element in terminal]
        for terminal in ET.fromstring(content).iter("Terminal")
    ]
    assert all(len(set(names)) == len(names) for names in per_terminal)
    assert len(list(chain(*per_terminal))) == len(members)


def test_log_categories_are_those_that_the_core_uses() -> None:
    _, two, three = describe("gearbox/ratio")
    used = set(re.findall(r'"(logStatus\w+)"', (native.C_SOURCES / "core.c").read_text()))
    for root in (two, three):
        assert {e.attrib["name"] for e in root.findall("LogCategories/Category")} == used


@pytest.mark.parametrize("fmi", [2, 3])
def test_binaries_of_all_platforms_are_where_the_standards_say(fmi: int) -> None:
    folders = {
        2: {"linux64", "win64", "darwin64", "aarch64-linux", "aarch64-darwin"},
        3: {
            *("x86_64-linux", "x86_64-windows", "x86_64-darwin"),
            *("aarch64-linux", "aarch64-darwin"),
        },
    }
    found = {p.fmi2 if fmi == 2 else p.fmi3 for p in PLATFORMS.values()}
    assert found == folders[fmi]


def test_archive_holds_what_the_description_names() -> None:

    for fmi in (2, 3):
        with zipfile.ZipFile(fmu("inertia/disc", fmi=fmi)) as archive:
            root = ET.fromstring(archive.read("modelDescription.xml"))
            names = set(archive.namelist())
            identifier = root.find("CoSimulation").attrib["modelIdentifier"]  # type: ignore[union-attr]
            if fmi == 2:
                files = {e.attrib["name"] for e in root.findall("CoSimulation/SourceFiles/File")}
            else:
                build = ET.fromstring(archive.read("sources/buildDescription.xml"))
                files = {e.attrib["name"] for e in build.iter("SourceFile")}
            assert {f"sources/{file}" for file in files} <= names
            assert any(f"/{identifier}." in n for n in names if n.startswith("binaries/"))
