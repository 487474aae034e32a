"""Systems written as SSP archives: valid, the same when read back, the same bytes."""

from __future__ import annotations

import importlib.util
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from cosim import Constant, Function, Master, System, Table, ssp
from cosim.errors import GraphError, InputError, ScenarioError, UnitError
from tests.cosim_fmus import rewrite
from tests.fmus import fmu
from tests.tiny_fmus import V, tiny

STEP = 1e-3


class Versioned:
    def __init__(self, fmi: int) -> None:
        self.fmi = fmi

    def path(self, variant: str) -> Path:
        return fmu(variant, "native", self.fmi)


def bench(fmi: int = 2) -> System:
    system = System("bench", Versioned(fmi), "motor, gearbox & load")
    system.add("motor", "dc_motor/electrical", {"w_ref": 50.0})
    system.add("gearbox", "gearbox/ratio", {"eta": 0.85, "ratio": 9.7})
    system.add("load", "inertia/disc", {"J": 0.1 + 0.2, "solver.method": 1})
    system.connect("motor.tau", "gearbox.tau_a")
    system.connect("gearbox.w_a", "motor.w")
    system.connect("gearbox.tau_b", "load.tau", factor=0.9, offset=1e-3)
    system.connect("gearbox.J_b", "load.J_added")
    system.connect("load.w", "gearbox.w_b")
    return system


def content(system: System) -> dict[str, object]:
    return {
        "name": system.name,
        "text": system.text,
        "fmus": {m.name: m.fmu.digest for m in system.members.values()},
        "parameters": {m.name: dict(m.parameters) for m in system.members.values()},
        "connections": system.connections,
        "units": {name: system.unit(name) for name in system.signals()},
        "bonds": system.bonds(),
    }


def schema(version: str, name: str) -> etree.XMLSchema:
    if version == "1.0":
        folder = Path(importlib.util.find_spec("fmpy").origin).parent / "ssp" / "schema"
    else:
        found = importlib.util.find_spec("pyssp_standard")
        if found is None:
            pytest.skip("the schemas of SSP 2.0 come with pyssp_standard, which is not installed")
        folder = Path(found.origin).parent / "resources" / "ssp2"
    return etree.XMLSchema(file=str(folder / f"SystemStructure{name}.xsd"))


@pytest.mark.parametrize("version", ["1.0", "2.0"])
@pytest.mark.parametrize("fmi", [2, 3])
def test_read_back_it_is_the_same_system(tmp_path: Path, version: str, fmi: int) -> None:
    system = bench(fmi)
    path = ssp.write(system, tmp_path / "bench.ssp", version=version)
    again = ssp.read(path)
    assert content(again) == content(system)
    runs = [Master(item, step=STEP).run(0.05).values for item in (system, again)]
    assert np.array_equal(*runs)


@pytest.mark.parametrize("version", ["1.0", "2.0"])
@pytest.mark.parametrize("fmi", [2, 3])
def test_files_are_valid(tmp_path: Path, version: str, fmi: int) -> None:
    path = ssp.write(
        bench(fmi), tmp_path / "bench.ssp", version=version,
        experiment=ssp.Experiment(0.0, 1.0, 1e-4, "jacobi"),
    )  # fmt: skip
    with zipfile.ZipFile(path) as archive:
        for name in archive.namelist():
            kind = {".ssd": "Description", ".ssv": "ParameterValues"}.get(Path(name).suffix)
            if kind:
                checker = schema(version, kind)
                assert checker.validate(etree.fromstring(archive.read(name))), checker.error_log
        kinds = {Path(name).suffix for name in archive.namelist()}
    assert kinds == {".ssd", ".ssv", ".fmu"}


@pytest.mark.parametrize("version", ["1.0", "2.0"])
def test_connected_texts_and_bytes_have_connectors(tmp_path: Path, version: str) -> None:
    ends = [V("s", "String", "output"), V("b", "Binary", "output"), V("t", "String", "output")]
    giver = tiny(tmp_path, ends, 'strcpy(v->s[0], "hi"); v->s[1][0] = 7; v->length[1] = 1;')
    takes = [
        V("s", "String", "input", ""),
        V("b", "Binary", "input", ""),
        V("y", "Float64", "output"),
    ]
    taker = tiny(tmp_path, takes, "v->r[2][0] = v->s[0][1] + v->s[1][0];", name="n")
    system = System("texts")
    system.add("a", str(giver))
    system.add("b", str(taker))
    system.connect("a.s", "b.s")
    system.connect("a.b", "b.b")
    path = ssp.write(system, tmp_path / "texts.ssp", version=version)
    with zipfile.ZipFile(path) as archive:
        root = etree.fromstring(archive.read("SystemStructure.ssd"))
    assert schema(version, "Description").validate(root)
    declared = [item.get("name") for item in root.iterfind(".//{*}Connector")]
    assert declared == ["s", "b", "s", "b", "y"]  # a.t feeds nothing
    assert Master(ssp.read(path), step=0.1).run(0.1)["b.y"][-1] == ord("i") + 7


@pytest.mark.parametrize("version", ["1.0", "2.0"])
def test_calculated_parameters_are_connected(tmp_path: Path, version: str) -> None:
    ends = [V("k", "Float64", "parameter", "1"), V("c", "Float64", "calculatedParameter"),
            V("d", "Float64", "calculatedParameter")]  # fmt: skip
    system = System("calculated")
    system.add("a", str(tiny(tmp_path, ends, "v->r[1][0] = 2 * v->r[0][0];")), {"k": 3.0})
    ends = [V("u", "Float64", "input", "0"), V("y", "Float64", "output")]
    system.add("b", str(tiny(tmp_path, ends, "v->r[1][0] = v->r[0][0];", name="n")))
    system.connect("a.c", "b.u")
    path = ssp.write(system, tmp_path / "calculated.ssp", version=version)
    with zipfile.ZipFile(path) as archive:
        root = etree.fromstring(archive.read("SystemStructure.ssd"))
    assert schema(version, "Description").validate(root)
    declared = [(item.get("name"), item.get("kind")) for item in root.iterfind(".//{*}Connector")]
    assert declared == [("c", "calculatedParameter"), ("u", "input"), ("y", "output")]
    for each in (system, ssp.read(path)):
        assert Master(each, step=0.1).run(0.1)["b.y"].tolist() == [6.0, 6.0]


def test_a_wrong_file_is_not_valid(tmp_path: Path) -> None:
    path = ssp.write(bench(), tmp_path / "bench.ssp")
    with zipfile.ZipFile(path) as archive:
        text = archive.read("SystemStructure.ssd").replace(b'kind="input"', b'kind="entry"')
    assert not schema("1.0", "Description").validate(etree.fromstring(text))


def test_fmpy_reads_it(tmp_path: Path) -> None:
    from fmpy.ssp.ssd import get_connections, read_ssd

    system = bench()
    found = read_ssd(str(ssp.write(system, tmp_path / "bench.ssp")), validate=True)
    names = {
        (f"{a.parent.name}.{a.name}", f"{b.parent.name}.{b.name}")
        for a, b in get_connections(found.system)
    }
    assert names == {(c.source, c.target) for c in system.connections}
    parameters = {
        (element.name, item.name): float(item.value)
        for element in found.system.elements
        for binding in element.parameterBindings
        for values in binding.parameterValues
        for item in values.parameters
    }
    assert parameters["gearbox", "eta"] == 0.85 and parameters["load", "J"] == 0.1 + 0.2


def test_the_same_system_gives_the_same_bytes(tmp_path: Path) -> None:
    first = ssp.write(bench(), tmp_path / "one.ssp").read_bytes()
    assert ssp.write(bench(), tmp_path / "deep" / "two.ssp").read_bytes() == first
    other = bench()
    other.set("load.J", 0.3)
    assert ssp.write(other, tmp_path / "three.ssp").read_bytes() != first


def test_instances_share_their_fmu_and_other_fmus_of_that_name_do_not(tmp_path: Path) -> None:
    folder = tmp_path / "other"
    folder.mkdir()
    other = rewrite(
        fmu("inertia/disc"), folder / fmu("inertia/disc").name,
        xml=lambda text: text.replace("energy stored", "Energy stored"),
    )  # fmt: skip
    system = System("two", Versioned(2))
    system.add("a", "inertia/disc")
    system.add("b", "inertia/disc")
    system.add("c", str(other))
    path = ssp.write(system, tmp_path / "two.ssp")
    with zipfile.ZipFile(path) as archive:
        assert sum(name.endswith(".fmu") for name in archive.namelist()) == 2
    again = ssp.read(path)
    assert [m.fmu.digest for m in again.members.values()] == [
        m.fmu.digest for m in system.members.values()
    ]


def test_inputs_over_time_come_back(tmp_path: Path) -> None:
    times = np.array([0.0, 0.01, 0.0305])
    signal = Table(times, [10.0, 50.0, 20.0], unit="rad/s", extend=True)
    system = bench()
    path = ssp.write(
        system, tmp_path / "bench.ssp", inputs={"motor.w_ref": signal},
        experiment=ssp.Experiment(0.0, 0.05, STEP, "gauss_seidel"),
    )  # fmt: skip
    scenario = ssp.read_scenario(path)
    assert (scenario.duration, scenario.step, scenario.algorithm) == (0.05, STEP, "gauss_seidel")
    runs = [
        Master(item, scenario.algorithm, STEP).run(0.05, inputs=inputs).values
        for item, inputs in (
            (system, {"motor.w_ref": signal}),
            (scenario.system.build(None), scenario.inputs),
        )
    ]
    assert np.array_equal(*runs)
    # a tool that does not know the table holds the first value
    assert ssp.read(path).members["motor"].parameters["w_ref"] == 10.0


def test_steps_of_inputs_come_at_their_time(tmp_path: Path) -> None:
    """However long a value holds, and with another step than that of the table."""

    def level(times: np.ndarray) -> np.ndarray:
        return 1.0 + (times > 0.7 - 1e-9) + (times > 5.0 - 1e-9)  # 7 * 0.1 is not 0.7

    path = ssp.write(
        bench(), tmp_path / "bench.ssp", inputs={"motor.w_ref": Function(level)},
        experiment=ssp.Experiment(0.0, 10.0, STEP),
    )  # fmt: skip
    again = ssp.read_scenario(path).inputs["motor.w_ref"]
    for step in (STEP, 0.7 * STEP, 0.1):
        times = step * np.arange(round(10.0 / step))
        assert np.array_equal(again.at(times), level(times))


def test_a_scenario_with_logged_inputs(tmp_path: Path) -> None:
    from cosim.running.runner import run_scenario
    from cosim.scenario import scenario

    file, _ = scenario.find("motor_bench")
    original = replace(file.scenario("ST1"), duration=0.6, record=None, references={}, checks=())
    path = ssp.export(original, tmp_path / "bench.ssp", Versioned(2))
    again = ssp.read_scenario(path)
    runs = [run_scenario(item, Versioned(2)).recording for item in (original, again)]
    every = round(original.period / original.step)
    for name in runs[0].names:
        assert np.array_equal(runs[0][name], runs[1][name][::every]), name
    assert np.ptp(runs[0]["load.w"]) > 0.1


def test_a_scenario_keeps_the_options_of_its_algorithm_and_its_tolerance(tmp_path: Path) -> None:
    plain = ssp.read_scenario(
        ssp.write(bench(), tmp_path / "a.ssp", experiment=ssp.Experiment(0.0, 0.05, STEP, "jacobi"))
    )
    assert (plain.options, plain.tolerance) == ({}, None)
    options = {"extrapolation": 2, "substeps": {"motor": 3}}
    given = replace(plain, options=options, tolerance=1e-7)
    again = ssp.read_scenario(ssp.export(given, tmp_path / "b.ssp", None))
    assert (again.algorithm, again.options, again.tolerance) == ("jacobi", options, 1e-7)
    plainly, *both = (
        Master(
            item.system.build(None), item.algorithm, item.step,
            options=item.options, tolerance=item.tolerance,
        ).run(item.duration)
        for item in (plain, given, again)
    )  # fmt: skip
    assert np.array_equal(both[0].values, both[1].values)
    assert not np.array_equal(both[0].values, plainly.values)
    bad = tmp_path / "bad.ssp"
    with zipfile.ZipFile(tmp_path / "b.ssp") as old, zipfile.ZipFile(bad, "w") as new:
        for name in old.namelist():
            new.writestr(name, old.read(name).replace(b"extrapolation", b"\\"))
    with pytest.raises(ScenarioError, match="is no JSON object"):
        ssp.read_scenario(bad)
    with pytest.raises(GraphError, match="is no JSON"):
        ssp.export(replace(plain, options={"extrapolation": Path()}), tmp_path / "c.ssp", None)


def test_constant_inputs_are_start_values(tmp_path: Path) -> None:
    path = ssp.write(bench(), tmp_path / "bench.ssp", inputs={"motor.w_ref": Constant(42.0)})
    again = ssp.read(path)
    assert again.members["motor"].parameters["w_ref"] == 42.0
    with zipfile.ZipFile(path) as archive:
        assert "resources/inputs.csv" not in archive.namelist()
    with pytest.raises(UnitError, match=r"input motor.w_ref .* 'm/s' .* 'rad/s'"):
        ssp.write(bench(), path, inputs={"motor.w_ref": Constant(1.0, "m/s")})
    ssp.write(bench(), path, inputs={"motor.w_ref": Constant(60.0, "rpm")})
    value = ssp.read(path).members["motor"].parameters["w_ref"]
    assert value == pytest.approx(2.0 * np.pi, rel=1e-15)  # one rounding of pi/30 times 60


def test_what_cannot_be_written_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.ssp"
    with pytest.raises(InputError, match=r"SSP version '3.0': choose 1.0 or 2.0"):
        ssp.write(bench(), path, version="3.0")
    with pytest.raises(GraphError, match=r"motor.w is already driven by gearbox.w_a"):
        ssp.write(bench(), path, inputs={"motor.w": 1.0})
    ramp = Table([0.0, 1.0], [0.0, 1.0], interpolation="linear")
    with pytest.raises(GraphError, match="changes over time, so the experiment needs a stop time"):
        ssp.write(bench(), path, inputs={"motor.w_ref": ramp})
    assert not path.exists()


def _arrays(tmp_path: Path) -> Path:
    """An FMI 3 FMU whose description has an array input and output."""

    def enlarge(text: str) -> str:
        lines = []
        for line in text.splitlines():
            if '<Float64 name="tau"' in line or '<Float64 name="w"' in line:
                head = line.rstrip().removesuffix("/>").rstrip(">")
                line = f'{head}><Dimension start="3"/></Float64>'
            lines.append(line)
        return "\n".join(lines)

    return rewrite(fmu("inertia/disc", "native", 3), tmp_path / "arrays.fmu", xml=enlarge)


def test_booleans_are_mapped_and_integers_not_scaled(tmp_path: Path, affine: Path) -> None:
    system = System("flags")
    for name in "abc":
        system.add(name, str(affine), {"n": 3, "on": False})
    system.connect("a.off", "b.on", factor=-1.0, offset=1.0)
    system.connect("a.off", "c.on", factor=0.0, offset=1.0)
    system.connect("a.next", "b.n")
    path = ssp.write(system, tmp_path / "flags.ssp")
    with zipfile.ZipFile(path) as archive:
        assert schema("1.0", "Description").validate(
            etree.fromstring(archive.read("SystemStructure.ssd"))
        )
    again = ssp.read(path)
    assert again.connections == system.connections
    assert again.members["a"].parameters == {"n": 3.0, "on": False}
    system.connect("b.next", "c.n", factor=2.0)
    with pytest.raises(GraphError, match=r"b.next -> c.n: SSP scales real numbers only, not Int32"):
        ssp.write(system, path)


def test_arrays_need_version_2(tmp_path: Path) -> None:
    path = _arrays(tmp_path)
    system = System("arrays")
    system.add("a", str(path), {"tau": [1.0, 2.0, 3.0]})
    with pytest.raises(GraphError, match=r"a.tau is an array, which SSP 1.0 cannot set"):
        ssp.write(system, tmp_path / "x.ssp")
    system.add("b", str(path))
    system.connect("a.w", "b.tau", factor=2.0, convert=False)
    target = ssp.write(system, tmp_path / "x.ssp", version="2.0")
    with zipfile.ZipFile(target) as archive:
        text = archive.read("SystemStructure.ssd")
        values = archive.read("resources/a.ssv")
    assert schema("2.0", "Description").validate(etree.fromstring(text))
    assert schema("2.0", "ParameterValues").validate(etree.fromstring(values))
    again = ssp.read(target)
    assert again.connections == system.connections and len(again.connections) == 3
    swapped = tmp_path / "swapped.ssp"
    with zipfile.ZipFile(target) as old, zipfile.ZipFile(swapped, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name.endswith(".ssd"):
                content = content.replace(
                    b'endConnector="tau"',
                    b'endConnector="tau" startIndices="1 2 3" endIndices="3 1 2"',
                )
            new.writestr(name, content)
    with pytest.raises(ScenarioError, match=r"a.w - b.tau joins single elements of arrays"):
        ssp.read(swapped)
    assert again.members["a"].parameters == {"tau": [1.0, 2.0, 3.0]}


def test_master_of_omsimulator_has_our_step(tmp_path: Path) -> None:
    path = ssp.write(bench(), tmp_path / "a.ssp", experiment=ssp.Experiment(0.0, 2.0, 1e-4))
    with zipfile.ZipFile(path) as archive:
        root = etree.fromstring(archive.read("SystemStructure.ssd"))
    # where its library and its Python package look; both take the first annotation only
    spaces = {prefix: uri for prefix, uri in root.nsmap.items() if prefix}
    place = "ssd:System/ssd:Annotations/ssc:Annotation[1]/oms:Annotations/oms:SimulationInformation"
    (known,) = root.findall(place, spaces)
    assert known.get("name") == "oms_ma_default" and known.get("method") == "oms_ma"
    (master,) = known.findall("oms:FixedStepMaster", spaces)
    assert float(known.get("fixedStepSize")) == float(master.get("stepSize")) == 1e-4
    assert master.get("description") == "oms-ma"
    plain = ssp.write(bench(), tmp_path / "b.ssp")
    with zipfile.ZipFile(plain) as archive:
        assert b"org.openmodelica" not in archive.read("SystemStructure.ssd")
