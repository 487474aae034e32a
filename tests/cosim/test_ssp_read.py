"""SSP packages as other tools write them: nested, with units, bindings and mappings."""

from __future__ import annotations

import math
import zipfile
from pathlib import Path

import numpy as np
import pytest

from cosim import Master, ssp
from cosim.errors import InputError, ScenarioError, UnitError
from tests.cosim_fmus import rewrite, slave
from tests.fmus import fmu
from tests.ssp_files import (
    GEAR,
    NAMES,
    A,
    binding,
    component,
    connection,
    connectors,
    package,
    real,
    ssd,
    ssm,
    ssv,
    system,
)


def wires(found: object) -> set[tuple[str, str, float, float]]:
    return {(c.source, c.target, c.gain, c.offset) for c in found.connections}


# -- connections -----------------------------------------------------------------------------------


def test_nested_systems_are_flattened(make) -> None:
    inner = system(
        component("c1", A, connectors(u="input", y="output"))
        + component("c 2", A, connectors(u="input", y="output")),
        connection(".in", "c1.u"),
        connection("c1.y", "c 2.u"),
        # start and end say nothing about the direction
        connection(".out", "c 2.y"),
        inner=connectors(**{"in": "input", "out": "output"}),
        name="sub",
    )
    root = system(
        inner + component("first", A) + component("last", A),
        connection("first.y", "sub.in"),
        connection("last.u", "sub.out"),
        connection(".set", "first.u"),
        connection("last.y", ".result"),
        inner=connectors(set="input", result="output"),
    )
    found = ssp.read_package(make(ssd(root)))
    assert list(found.system.instances) == ["sub_c1", "sub_c_2", "first", "last"]
    assert found.elements["sub.c 2"] == "sub_c_2"
    assert wires(found.system.build(None)) == {
        ("sub_c1.y", "sub_c_2.u", 1.0, 0.0),
        ("first.y", "sub_c1.u", 1.0, 0.0),
        ("sub_c_2.y", "last.u", 1.0, 0.0),
    }
    assert [t.name for t in found.inputs["set"]] == ["first.u"]
    assert found.outputs["result"].name == "last.y"


def test_transformations_on_the_way_add_up(make) -> None:
    scale = '<ssc:LinearTransformation factor="{}" offset="{}"/>'
    inner = system(
        component("c", A), connection(".in", "c.u", scale.format(3.0, 4.0)),
        inner=connectors(**{"in": "input"}), name="sub",
    )  # fmt: skip
    root = system(component("a", A) + inner, connection("a.y", "sub.in", scale.format(2.0, 1.0)))
    # 3 (2 y + 1) + 4
    assert wires(ssp.read(make(ssd(root)))) == {("a.y", "sub_c.u", 6.0, 7.0)}


def test_booleans_are_negated(make) -> None:
    entries = (
        '<ssc:MapEntry source="true" target="false"/><ssc:MapEntry source="false" target="true"/>'
    )
    negated = f"<ssc:BooleanMappingTransformation>{entries}</ssc:BooleanMappingTransformation>"
    partial = (
        '<ssc:BooleanMappingTransformation><ssc:MapEntry source="true" target="false"/>'
        "</ssc:BooleanMappingTransformation>"
    )
    root = system(
        component("a", A) + component("b", A) + component("c", A),
        connection("a.off", "b.on", negated),
        connection("a.off", "c.on", partial),  # false stays as it is: always false
        connection("a.next", "b.n"),
    )
    found = ssp.read(make(ssd(root)))
    assert wires(found) == {
        ("a.off", "b.on", -1.0, 1.0), ("a.off", "c.on", 0.0, 0.0), ("a.next", "b.n", 1.0, 0.0),
    }  # fmt: skip
    recording = Master(found, step=0.1).run(0.3, record=["a.off", "b.off", "c.off", "b.next"])
    assert recording["a.off"][-1] == 0.0 and recording["b.off"][-1] == 0.0
    assert recording["c.off"][-1] == 1.0 and recording["b.next"][-1] == 4.0


def test_units_of_connectors_convert_unless_suppressed(make) -> None:
    gear = fmu("gearbox/ratio")
    shaft = connectors(w_a="output Real rad/s", w_b="input Real rad/s")
    boundary = connectors(speed="output Real rpm", plain="output")
    for attributes, factor in (("", 30.0 / math.pi), ('suppressUnitConversion="true"', 1.0)):
        root = system(
            component("g", GEAR, shaft),
            connection("g.w_a", ".speed", attributes=attributes),
            connection("g.w_a", ".plain"),
            inner=boundary,
        )
        found = ssp.read_package(make(ssd(root), {GEAR: gear}))
        assert found.outputs["speed"].factor == pytest.approx(factor, rel=1e-15)  # one division
        assert found.outputs["plain"].factor == 1.0


def test_a_linear_transformation_comes_after_the_unit_conversion(make) -> None:
    scale = '<ssc:LinearTransformation factor="2.0" offset="5.0"/>'
    root = system(
        component("g", GEAR),
        connection("g.w_a", ".speed", scale),
        inner=connectors(speed="output Real rpm"),
    )
    found = ssp.read_package(make(ssd(root), {GEAR: fmu("gearbox/ratio")}))
    terminal = found.outputs["speed"]
    assert terminal.factor == pytest.approx(60.0 / math.pi, rel=1e-15)  # one division
    assert terminal.offset == 5.0


def test_units_that_do_not_convert(make) -> None:
    root = system(
        component("g", GEAR), connection("g.w_a", ".length"),
        inner=connectors(length="output Real m"),
    )  # fmt: skip
    with pytest.raises(UnitError, match=r"g.w_a - length: unit 'rad/s' .* into 'm'"):
        ssp.read(make(ssd(root), {GEAR: fmu("gearbox/ratio")}))


def test_signal_dictionaries_are_buses(make) -> None:
    entries = "".join(
        f'<ssb:DictionaryEntry name="{name}"><ssc:Real/></ssb:DictionaryEntry>' for name in "st"
    )
    dictionary = f'<ssb:SignalDictionary {NAMES} version="1.0">{entries}</ssb:SignalDictionary>'
    reference = (
        '<ssd:SignalDictionaryReference name="bus" dictionary="D">{}'
        "</ssd:SignalDictionaryReference>"
    )
    inner = system(
        component("c", A) + reference.format(connectors(s="inout", t="inout")),
        connection("bus.s", "c.u"),
        connection("c.y", "bus.t"),
        name="sub",
    )
    declared = (
        '<ssd:SignalDictionaries><ssd:SignalDictionary name="D" source="bus.ssb"/>'
        "</ssd:SignalDictionaries>"
    )
    root = system(
        component("a", A) + component("b", A) + reference.format(connectors(s="inout", t="inout"))
        + inner,
        connection("a.y", "bus.s"),
        connection("bus.t", "b.u"),
        after=declared,
    )  # fmt: skip
    found = ssp.read(make(ssd(root), {"bus.ssb": dictionary}))
    assert wires(found) == {("a.y", "sub_c.u", 1.0, 0.0), ("sub_c.y", "b.u", 1.0, 0.0)}


def test_a_package_inside_a_package(make, tmp_path: Path, affine: Path) -> None:
    nested = package(
        tmp_path / "nested.ssp",
        ssd(
            system(
                component("c", "resources/a.fmu"), connection(".in", "c.u"),
                inner=connectors(**{"in": "input"})
                + binding(ssv(real("c.a", 2.0), real("c.b", 3.0))),
            )
        ),
        {"resources/a.fmu": affine},
    )  # fmt: skip
    root = system(
        component("a", A)
        + component(
            "box", "resources/nested.ssp", binding(ssv(real("c.b", 4.0))),
            'type="application/x-ssp-package"',
        ),
        connection("a.y", "box.in"),
    )  # fmt: skip
    found = ssp.read(make(ssd(root), {"resources/nested.ssp": nested}))
    assert wires(found) == {("a.y", "box_c.u", 1.0, 0.0)}
    assert found.members["box_c"].parameters == {"a": 2.0, "b": 4.0}


# -- parameters ------------------------------------------------------------------------------------


def test_outer_bindings_win_over_inner_and_later_over_earlier(make) -> None:
    two = (
        "<ssd:ParameterBindings>"
        + binding(ssv(real("a", 1.0), real("b", 1.0), real("u", 1.0)))
        .removeprefix("<ssd:ParameterBindings>").removesuffix("</ssd:ParameterBindings>")
        + '<ssd:ParameterBinding source="resources/late.ssv"/></ssd:ParameterBindings>'
    )  # fmt: skip
    root = system(component("c", A, two), inner=binding(ssv(real("c.u", 3.0))))
    files = {"resources/late.ssv": ssv(real("b", 2.0), real("u", 2.0))}
    found = ssp.read_package(make(ssd(root), files))
    assert found.system.parameters == {"c.a": 1.0, "c.b": 2.0, "c.u": 3.0}
    assert found.ignored == ()


def test_a_set_for_several_elements_may_match_in_some(make) -> None:
    shared = (
        '<ssd:ParameterBindings><ssd:ParameterBinding source="resources/p.ssv"/>'
        "</ssd:ParameterBindings>"
    )
    root = system(component("c", A, shared) + component("g", GEAR, shared))
    files = {"resources/p.ssv": ssv(real("a", 2.0), real("eta", 0.5)), GEAR: fmu("gearbox/ratio")}
    found = ssp.read_package(make(ssd(root), files))
    assert found.system.parameters == {"c.a": 2.0, "g.eta": 0.5}
    assert set(found.ignored) == {"c.eta", "g.a"}


@pytest.mark.parametrize(
    ("value", "given"), [("2", 2.0), ("-7", -7.0), ("9007199254740992", 9007199254740992.0)]
)
def test_whole_numbers_map_to_floating_point_exactly(make, value: str, given: float) -> None:
    one = f'<ssv:Parameter name="a"><ssv:Integer value="{value}"/></ssv:Parameter>'
    found = ssp.read_package(make(ssd(system(component("c", A, binding(ssv(one)))))))
    number = found.system.parameters["c.a"]
    assert number == given and isinstance(number, float)


def test_whole_numbers_without_a_floating_point_number(make) -> None:
    one = '<ssv:Parameter name="a"><ssv:Int64 value="9007199254740993"/></ssv:Parameter>'
    with pytest.raises(ScenarioError, match=r"'a' = 9007199254740993 has no exact .* c\.a takes"):
        ssp.read_package(make(ssd(system(component("c", A, binding(ssv(one)))))))


def test_a_parameter_that_matches_nothing(make) -> None:
    alone = system(component("c", A, binding(ssv(real("aa", 1.0)))))
    with pytest.raises(ScenarioError, match=r"'aa' matches nothing in c, .* did you mean 'a'"):
        ssp.read_package(make(ssd(alone)))
    outside = system(component("c", A), inner=binding(ssv(real("c.aa", 1.0))))
    with pytest.raises(
        ScenarioError, match=r"'c.aa' matches nothing in the root system.* did you mean 'c.a'"
    ):
        ssp.read_package(make(ssd(outside)))
    mapping = ssm('<ssm:MappingEntry source="gainn" target="a"/>')
    mapped = system(component("c", A, binding(ssv(real("gain", 1.0)), mapping)))
    with pytest.raises(ScenarioError, match=r"mapping of c names 'gainn', .* did you mean 'gain'"):
        ssp.read_package(make(ssd(mapped)))


def test_mapping_names_scales_and_leaves_out(make) -> None:
    mapping = ssm(
        '<ssm:MappingEntry source="gain" target="a">'
        '<ssc:LinearTransformation factor="10" offset="1"/></ssm:MappingEntry>',
        '<ssm:MappingEntry source="gain" target="u"/>',
    )
    values = ssv(real("gain", 2.0), real("b", 5.0))
    found = ssp.read_package(make(ssd(system(component("c", A, binding(values, mapping))))))
    assert found.system.parameters == {"c.a": 21.0, "c.u": 2.0}  # b is not mapped
    files = {"x.ssv": values, "x.ssm": mapping}
    outside = (
        '<ssd:ParameterBindings><ssd:ParameterBinding source="x.ssv">'
        '<ssd:ParameterMapping source="x.ssm"/></ssd:ParameterBinding></ssd:ParameterBindings>'
    )
    again = ssp.read_package(make(ssd(system(component("c", A, outside))), files))
    assert again.system.parameters == found.system.parameters


def test_parameters_with_units(make) -> None:
    gear = {GEAR: fmu("gearbox/ratio")}
    values = ssv(real("J_a", 250.0, "g.m2"))
    plain = ssm('<ssm:MappingEntry source="J_a" target="J_a" suppressUnitConversion="true"/>')
    for mapping, expected in (("", 0.25), (plain, 250.0)):
        root = system(component("g", GEAR, binding(values, mapping)))
        found = ssp.read_package(make(ssd(root), gear))
        assert found.system.parameters == {"g.J_a": expected}
    wrong = system(component("g", GEAR, binding(ssv(real("J_a", 1.0, "rpm")))))
    with pytest.raises(UnitError, match=r"parameter 'J_a': unit 'rpm' .* 'kg.m2'"):
        ssp.read(make(ssd(wrong), gear))


def test_parameters_of_a_system_reach_what_they_are_connected_to(make) -> None:
    inner = system(
        component("c", A) + component("d", A),
        connection(".gain", "c.a", '<ssc:LinearTransformation factor="2" offset="0"/>'),
        connection(".gain", "d.a"),
        inner=connectors(gain="parameter"),
        name="sub",
    )
    root = system(inner, inner=binding(ssv(real("gain", 3.0)), attributes='prefix="sub."'))
    found = ssp.read_package(make(ssd(root)))
    assert found.system.parameters == {"sub_c.a": 6.0, "sub_d.a": 3.0}


def test_types_of_parameters(make) -> None:
    values = ssv(
        '<ssv:Parameter name="n"><ssv:Integer value="7"/></ssv:Parameter>',
        '<ssv:Parameter name="on"><ssv:Boolean value="false"/></ssv:Parameter>',
    )
    mapping = ssm(
        '<ssm:MappingEntry source="n" target="n"><ssc:IntegerMappingTransformation>'
        '<ssc:MapEntry source="7" target="8"/></ssc:IntegerMappingTransformation>'
        "</ssm:MappingEntry>",
        '<ssm:MappingEntry source="on" target="on"/>',
    )
    found = ssp.read(make(ssd(system(component("c", A, binding(values, mapping))))))
    recording = Master(found, step=0.1).run(0.1, record=["c.next", "c.off"])
    assert recording["c.next"][0] == 9.0 and recording["c.off"][0] == 1.0


def test_enumerations_go_by_item_of_the_fmu(make, affine: Path, tmp_path: Path) -> None:
    def declare(text: str) -> str:
        types = (
            '<TypeDefinitions><SimpleType name="Mode"><Enumeration><Item name="slow" value="1"/>'
            '<Item name="fast" value="4"/></Enumeration></SimpleType></TypeDefinitions>'
        )
        head, mark, tail = text.partition("<ModelVariables>")
        before, name, rest = tail.partition('name="n"')
        return head + types + mark + before + name + rest.replace(
            "<Integer", '<Enumeration declaredType="Mode"', 1
        ).replace("</Integer>", "</Enumeration>", 1)  # fmt: skip

    modes = rewrite(affine, tmp_path / "modes.fmu", xml=declare)
    fast = '<ssv:Parameter name="n"><ssv:Enumeration value="{}"/></ssv:Parameter>'
    files = {"resources/modes.fmu": modes}
    root = system(component("c", "resources/modes.fmu", binding(ssv(fast.format("fast")))))
    assert ssp.read_package(make(ssd(root), files)).system.parameters == {"c.n": 4}
    wrong = system(component("c", "resources/modes.fmu", binding(ssv(fast.format("lazy")))))
    with pytest.raises(ScenarioError, match=r"parameter 'n': 'lazy' is no item of the variable's"):
        ssp.read(make(ssd(wrong), files))


# -- runs ------------------------------------------------------------------------------------------

CELL = """
from pythonfmu import Fmi2Causality as C, Fmi2Initial, Fmi2Slave, Real


class {name}(Fmi2Slave):
    def __init__(self, **arguments):
        super().__init__(**arguments)
        self.k, self.T, self.u, self.y = 1.2, 0.25, 0.0, 0.0
        self.register_variable(Real("k", causality=C.parameter, variability="fixed"))
        self.register_variable(Real("T", causality=C.parameter, variability="fixed"))
        self.register_variable(Real("u", causality=C.input))
        self.register_variable(Real("y", causality=C.output, initial=Fmi2Initial.exact))

    def do_step(self, time, size):
        self.y = self.y + size / self.T * (self.k * max(-1.0, min(1.0, self.u)) - self.y)
        return True
"""


def test_a_plain_ring_runs_exactly(make, tmp_path: Path) -> None:
    """Twelve cells in a ring, one of them inverting, in a package without any annotation."""
    path = slave(tmp_path, "cell", CELL, "pythonfmu")
    inputs = connectors(u="input", y="output")
    start = binding(ssv(real("k", -1.2), real("y", 0.5)))
    cells = "".join(
        component(f"c{i}", "resources/cell.fmu", inputs + (start if i == 0 else ""))
        for i in range(12)
    )
    ring = [connection(f"c{i}.y", f"c{(i + 1) % 12}.u") for i in range(12)]
    found = ssp.read(make(ssd(system(cells, *ring)), {"resources/cell.fmu": path}))
    step, count = 0.125, 200
    names = [f"c{i}.y" for i in range(12)]
    recording = Master(found, "jacobi", step).run(step * count, record=names)
    gains, y = [-1.2] + [1.2] * 11, [0.5] + [0.0] * 11
    expected = [list(y)]
    for _ in range(count):
        y = [
            y[i] + step / 0.25 * (gains[i] * max(-1.0, min(1.0, y[i - 1])) - y[i])
            for i in range(12)
        ]
        expected.append(y)
    assert np.array_equal(recording.values, np.array(expected))
    assert np.ptp(recording.values[-100:]) > 0.5  # it oscillates for ever


def test_a_chain_with_an_open_input_keeps_its_start_value(make) -> None:
    root = system(
        component("a", A, binding(ssv(real("u", 3.0)))) + component("b", A),
        connection("a.y", "b.u"),
    )
    found = ssp.read(make(ssd(root)))
    assert found.open_inputs() == ["a.u", "a.n", "a.on", "b.n", "b.on"]
    assert Master(found, step=0.5).run(1.0, record=["b.y"])["b.y"][-1] == 3.0


def test_a_scenario_from_a_package(make) -> None:
    oms = (
        '<ssd:DefaultExperiment startTime="1.0" stopTime="3.0"><ssd:Annotations>'
        '<ssc:Annotation type="x"><x:FixedStepMaster xmlns:x="x" stepSize="0.5"/>'
        "</ssc:Annotation></ssd:Annotations></ssd:DefaultExperiment>"
    )
    root = system(
        component("a", A),
        connection(".set", "a.u", '<ssc:LinearTransformation factor="2" offset="1"/>'),
        inner=connectors(set="input"),
    )
    path = make(ssd(root, oms))
    scenario = ssp.read_scenario(path, inputs={"set": 5.0})
    assert (scenario.start, scenario.duration, scenario.step) == (1.0, 2.0, 0.5)
    recording = Master(scenario.system.build(None), step=scenario.step).run(
        scenario.duration, start=scenario.start, inputs=scenario.inputs, record=["a.y"]
    )
    assert recording.time[-1] == 3.0 and np.all(recording["a.y"] == 11.0)
    with pytest.raises(
        InputError, match=r"the root system has no input 'sett'; did you mean 'set'"
    ):
        ssp.read_scenario(path, inputs={"sett": 5.0})
    silent = make(ssd(root))
    with pytest.raises(ScenarioError, match=r"says nothing about the duration; give one"):
        ssp.read_scenario(silent)
    with pytest.raises(ScenarioError, match=r"says nothing about the step; give one"):
        ssp.read_scenario(silent, duration=1.0)


def test_folders_and_other_structures_of_a_package(make, tmp_path: Path) -> None:
    path = make(ssd(system(component("a", A))), {"Other.ssd": ssd(system(component("b", A)))})
    assert list(ssp.read(path, ssd="Other.ssd").members) == ["b"]
    folder = tmp_path / "unpacked"
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
    assert list(ssp.read(folder).members) == ["a"]
    assert list(ssp.read(folder / "Other.ssd").members) == ["b"]
    with pytest.raises(
        ScenarioError, match=r"has no New.ssd; it has Other.ssd, SystemStructure.ssd"
    ):
        ssp.read(path, ssd="New.ssd")
