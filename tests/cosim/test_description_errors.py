"""What is wrong in a description is named with its element and attribute, in the words of FMI."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from cosim.errors import FmuFileError
from cosim.fmu.archive import open_fmu
from tests import small_fmus
from tests.small_fmus import T3, U3, Y3, U, Y, fmi2, fmi3

NO_TYPE = '<ScalarVariable name="u" valueReference="0" causality="input"/>'
UNIT = '<UnitDefinitions><Unit name="degC"><BaseUnit K="1" offset="{}"/></Unit></UnitDefinitions>'
ITEMS = (
    '<TypeDefinitions><SimpleType name="t"><Enumeration><Item name="a" value="{}"/></Enumeration>'
    "</SimpleType></TypeDefinitions>"
)
MODE = (
    '<ScalarVariable name="mode" valueReference="3" causality="parameter" variability="fixed">'
    '<Enumeration declaredType="t" start="1"/></ScalarVariable>'
)
BROKEN = {
    "causality": (fmi2(U + Y.replace('"output"', '"Output"')),
                  "<ScalarVariable> 'y' has causality 'Output'; did you mean 'output'"),
    "variability": (fmi3(T3 + U3.replace("input", 'input" variability="Discrete') + Y3),
                    "<Float64> 'u' has variability 'Discrete'; did you mean 'discrete'"),
    "initial": (fmi2(U + Y.replace('causality="output"', 'causality="output" initial="exakt"')),
                "'y' has initial 'exakt'; did you mean 'exact'"),
    "no type": (fmi2(NO_TYPE + Y), "<ScalarVariable> 'u' has no type (Real, Integer"),
    "no name": (fmi3(T3 + U3.replace('name="u" ', "") + Y3), "<Float64> has no name"),
    "no reference": (fmi3(T3 + U3.replace('valueReference="1" ', "") + Y3),
                     "<Float64> 'u' has no valueReference"),
    "reference": (fmi2(U.replace('valueReference="0"', 'valueReference="a"') + Y),
                  "<ScalarVariable> 'u' has valueReference = 'a', which is no whole number"),
    "start": (fmi2(U.replace('"1.0"', '"1,0"') + Y),
              "<Real> has start = '1,0', which is no number"),
    "digits": (fmi2(U.replace('"1.0"', '"1_0"') + Y),
               "<Real> has start = '1_0', which is no number"),
    "long": (fmi2(U.replace('"1.0"', '"' + "x" * 5000 + '"') + Y), "x …, which is no number"),
    "truth": (fmi3(T3 + '<Boolean name="on" valueReference="1" causality="input" start="True"/>'
                   + Y3), "<Boolean> 'on' has start = 'True', which is neither true nor false"),
    "bytes": (fmi3(T3 + '<Binary name="b" valueReference="1" causality="input"><Start value="xy"/>'
                   "</Binary>" + Y3), "<Start> has value = 'xy', which are no hexadecimal digits"),
    "bound": (fmi3(T3 + U3.replace("start=", 'min="low" start=') + Y3),
              "<Float64> 'u' has min = 'low', which is no number"),
    "unit": (fmi2(definitions=UNIT.format("273,15")),
             "<BaseUnit> has offset = '273,15', which is no number"),
    "item": (fmi2(U + Y + MODE, definitions=ITEMS.format("one")),
             "<Item> 'a' has value = 'one', which is no whole number"),
    "structure": (fmi2(structure='<Outputs><Unknown index="7"/></Outputs>'),
                  "<Unknown> of ModelStructure has index 7, which no variable has"),
    "dependency": (fmi2(structure='<Outputs><Unknown index="2" dependencies="u"/></Outputs>'),
                   "<Unknown> has dependencies = 'u', which is no whole number"),
    "size": (fmi3(T3 + U3 + Y3.replace("/>", '><Dimension valueReference="9"/></Float64>')),
             "<Float64> 'y' has as many elements as value reference 9, which is no UInt64"),
    "experiment": (fmi2(definitions='<DefaultExperiment stepSize="10 ms"/>'),
                   "<DefaultExperiment> has stepSize = '10 ms', which is no number"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_description_is_refused_with_its_place(tmp_path: Path, case: str) -> None:
    xml, text = BROKEN[case]
    path = small_fmus.pack(tmp_path / "m.fmu", xml)
    with pytest.raises(FmuFileError, match=re.escape(text)) as raised:
        open_fmu(path)
    assert "Error" not in str(raised.value)  # no name of an exception of Python
    assert len(str(raised.value)) < 400 + len(str(path))


@pytest.mark.parametrize("version", ["2.1", "1.0", "3", "2.0-beta", ""])
def test_versions_that_do_not_exist_are_refused(tmp_path: Path, version: str) -> None:
    xml = fmi2().replace('fmiVersion="2.0"', f'fmiVersion="{version}"')
    with pytest.raises(FmuFileError, match=r"FMI 2\.0 and 3\.0 are supported"):
        open_fmu(small_fmus.pack(tmp_path / "m.fmu", xml))


@pytest.mark.parametrize("version", ["3.0", "3.0.1", "3.1"])
def test_later_versions_of_fmi_3_are_read(tmp_path: Path, version: str) -> None:
    xml = fmi3().replace('fmiVersion="3.0"', f'fmiVersion="{version}"')
    assert open_fmu(small_fmus.pack(tmp_path / "m.fmu", xml)).description.fmi == 3


def test_a_sound_description_is_read(tmp_path: Path) -> None:
    xml = fmi2(U + Y + MODE, definitions=UNIT.format("273.15") + ITEMS.format("1"))
    found = open_fmu(small_fmus.pack(tmp_path / "m.fmu", xml)).description
    assert found.variables["mode"].items == {1: "a"}
    assert found.variables["u"].start == (1.0,)
