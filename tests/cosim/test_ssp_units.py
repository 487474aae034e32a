"""Units in SSP packages: differences have no offsets, connectors of the root system have a unit."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim import Constant, Master, System, Table, ssp
from cosim.errors import UnitError
from cosim.ssp.experiment import read_scenario
from cosim.ssp.read import Experiment
from tests.ssp_files import (
    binding,
    component,
    connection,
    connectors,
    package,
    real,
    ssd,
    ssv,
    system,
)
from tests.tiny_fmus import V, tiny

UNITS = """<UnitDefinitions><Unit name="K"><BaseUnit K="1"/></Unit>
<Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit>
<Unit name="rad/s"><BaseUnit rad="1" s="-1"/></Unit></UnitDefinitions>"""
COMMON = """<ssc:Unit name="K"><ssc:BaseUnit K="1"/></ssc:Unit>
<ssc:Unit name="degC"><ssc:BaseUnit K="1" offset="273.15"/></ssc:Unit>"""
KINDS = pytest.mark.parametrize(("relative", "expected"), [(True, 5.0), (False, 278.15)])


def thermal(folder: Path, relative: bool) -> tuple[Path, Path]:
    """A source of 5 degC, and a follower in K with a parameter."""
    more = 'relativeQuantity="true"' if relative else ""
    source = tiny(
        folder,
        [V("y", "Float64", "output", inner=f'unit="degC" {more}')],
        "v->r[0][0] = 5;",
        definitions=UNITS,
        name="source",
    )
    sink = tiny(
        folder,
        [
            V("u", "Float64", "input", "0", inner=f'unit="K" {more}'),
            V("z", "Float64", "output", inner=f'unit="K" {more}'),
            V("p", "Float64", "parameter", "1", inner=f'unit="K" {more}'),
            V("q", "Float64", "output", inner=f'unit="K" {more}'),
        ],
        "v->r[1][0] = v->r[0][0]; v->r[3][0] = v->r[2][0];",
        definitions=UNITS,
        name="sink",
    )
    return source, sink


def write(folder: Path, root: str, **fmus: Path) -> Path:
    structure = ssd(root, '<ssd:DefaultExperiment startTime="0" stopTime="0.2"/>', "2.0")
    structure = structure.replace("</ssd:Units>", COMMON + "</ssd:Units>")
    files = {f"resources/{name}.fmu": path for name, path in fmus.items()}
    return package(folder / "foreign.ssp", structure, files)


@KINDS
def test_connections_and_parameters_of_differences_have_no_offset(
    tmp_path: Path, relative: bool, expected: float
) -> None:
    source, sink = thermal(tmp_path, relative)
    values = ssv(real("p", 5, "degC")).replace("</ssv:Units>", COMMON + "</ssv:Units>")
    inside = system(  # the connectors on the way do not know that it is a difference
        component("sink", "resources/sink.fmu", connectors(u="input") + binding(values)),
        connection(".to", "sink.u"),
        inner=connectors(to="input Real K"),
        name="inside",
    )
    root = system(
        component("source", "resources/source.fmu", connectors(y="output")) + inside,
        connection("source.y", "inside.to"),
    )
    found = ssp.read(write(tmp_path, root, source=source, sink=sink))
    names = ["inside_sink.z", "inside_sink.q"]
    assert Master(found, step=0.1).run(0.2, record=names).values[-1].tolist() == [expected] * 2


@KINDS
@pytest.mark.parametrize(
    "driver", [Constant(5.0, "degC"), Table([0.0], [5.0], unit="degC", extend=True)]
)
def test_exported_inputs_are_the_same_when_read_back(
    tmp_path: Path, driver: Constant | Table, relative: bool, expected: float
) -> None:
    _, sink = thermal(tmp_path, relative)
    first = System()
    first.add("m", str(sink))
    path = ssp.write(
        first,
        tmp_path / "out.ssp",
        version="2.0",
        experiment=Experiment(0.0, 0.2, 0.1, "jacobi"),
        inputs={"m.u": driver},
    )
    found = read_scenario(path)
    for made, inputs in ((first, {"m.u": driver}), (found.system.build(None), found.inputs)):
        recording = Master(made, step=0.1).run(0.2, inputs=inputs, record=["m.z"])
        assert recording.values[-1, 0] == expected


@KINDS
@pytest.mark.parametrize(
    ("unit", "of_five"), [("", (5.0, 278.15)), ("degC", (5.0, 278.15)), ("K", (5.0, 5.0))]
)
def test_a_signal_in_its_own_unit_is_converted_to_that_of_the_root_connector(
    tmp_path: Path, unit: str, of_five: tuple[float, float], relative: bool, expected: float
) -> None:
    _, sink = thermal(tmp_path, relative)
    root = system(
        component("sink", "resources/sink.fmu", connectors(u="input")),
        connection(".to", "sink.u"),
        inner=connectors(to="input Real degC"),
    )
    signal = Table([0.0], [5.0], unit=unit, extend=True)
    found = read_scenario(write(tmp_path, root, sink=sink), step=0.1, inputs={"to": signal})
    master = Master(found.system.build(None), step=0.1)
    value = master.run(0.2, inputs=found.inputs, record=["sink.z"]).values[-1, 0]
    assert value == pytest.approx(of_five[0 if relative else 1], rel=1e-12)  # rounding


@pytest.mark.parametrize(("unit", "inside"), [("", 0.2), ("rpm", 0.2), ("rad/s", 2.0)])
def test_factors_of_units_count_once(tmp_path: Path, unit: str, inside: float) -> None:
    fmu = tiny(
        tmp_path,
        [V("u", "Float64", "input", "0", inner='unit="rad/s"'), V("z", "Float64", "output")],
        "v->r[1][0] = v->r[0][0];",
        definitions=UNITS,
    )
    root = system(
        component("m", "resources/m.fmu", connectors(u="input")),
        connection(".to", "m.u"),
        inner=connectors(to="input Real rpm"),
    )
    path = write(tmp_path, root, m=fmu)
    rpm = 0.10471975511965977
    signal = Table([0.0], [inside if unit == "rad/s" else inside / rpm], unit=unit, extend=True)
    found = read_scenario(path, step=0.1, inputs={"to": signal})
    master = Master(found.system.build(None), step=0.1)
    value = master.run(0.2, inputs=found.inputs, record=["m.z"]).values[-1, 0]
    assert value == pytest.approx(inside, rel=1e-12)  # rounding
    with pytest.raises(UnitError, match="input to from"):
        read_scenario(path, step=0.1, inputs={"to": Table([0.0], [1.0], unit="kg", extend=True)})
