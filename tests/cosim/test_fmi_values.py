"""Values of every type of FMI, on their way from a scenario to an FMU, to another and to a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cosim
from cosim import Constant, Master, Recording, System, Table, read_recording
from cosim.errors import (
    CosimError,
    GraphError,
    ScenarioError,
    StepError,
    UnknownNameError,
    ValueRangeError,
)
from cosim.files import flatten
from cosim.master import kernel
from sources.packaging.kernel import build_kernel
from sources.packaging.platforms import host_platform
from tests.tiny_fmus import V, tiny

BIG = 2**63 - 1
BEYOND = 2**53 + 1
"""The first integer that a double does not carry."""
INTEGERS3 = ("Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64")
MODES2 = (
    '<TypeDefinitions><SimpleType name="Mode"><Enumeration><Item name="off" value="1"/>'
    '<Item name="slow" value="2"/><Item name="fast" value="7"/></Enumeration></SimpleType>'
    "</TypeDefinitions>"
)
MODES3 = (
    '<TypeDefinitions><EnumerationType name="Mode"><Item name="off" value="1"/>'
    '<Item name="slow" value="2"/><Item name="fast" value="7"/></EnumerationType></TypeDefinitions>'
)
DEGREES = (
    '<UnitDefinitions><Unit name="K"><BaseUnit K="1"/></Unit>'
    '<Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit></UnitDefinitions>'
)


def passing(folder: Path, type_: str, fmi: int = 3, name: str = "m") -> Path:
    """y = u of one type."""
    zero = {"String": "", "Binary": "", "Boolean": "false"}.get(type_, "0")
    law = "memcpy(v->s[1], v->s[0], TEXT); v->length[1] = v->length[0]; v->n[1][0] = v->n[0][0]; "
    law += "v->r[1][0] = v->r[0][0];"
    ends = [V("u", type_, "input", zero), V("y", type_, "output")]
    return tiny(folder, ends, law, fmi=fmi, name=name)


def alone(fmu: Path, parameters: dict[str, Any] | None = None) -> System:
    system = System("alone")
    system.add("a", str(fmu), parameters)
    return system


def pair(folder: Path, source: str, target: str, fmi: int = 3) -> System:
    system = System("pair")
    system.add("a", str(passing(folder, source, fmi, "source")))
    system.add("b", str(passing(folder, target, fmi, "target")))
    system.connect("a.y", "b.u")
    return system


def short(system: System, **settings: Any) -> Recording:
    step = settings.pop("step", 0.1)
    options = {k: settings.pop(k) for k in ("executor", "algorithm", "isolate") if k in settings}
    return Master(system, step=step, **options).run(settings.pop("duration", 0.4), **settings)


def shown(column: Any) -> list[Any]:
    """Values in the order in which they came; plain exchange delays each by a step per FMU."""
    return list(dict.fromkeys(column.tolist()))


# -- units ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(("relative", "arrives"), [("true", 5.0), ("false", 278.15)])
def test_a_difference_of_temperatures_has_no_offset(
    relative: str, arrives: float, fmi: int, tmp_path: Path
) -> None:
    def fmu(unit: str, name: str) -> str:
        inner = f'unit="{unit}" relativeQuantity="{relative}"'
        ends = [
            V("u", "Float64", "input", "5", inner=inner),
            V("y", "Float64", "output", inner=inner),
        ]
        law = "v->r[1][0] = v->r[0][0];"
        begin = "v->r[0][0] = 5;"
        return str(tiny(tmp_path, ends, law, fmi=fmi, begin=begin, name=name, definitions=DEGREES))

    system = System("warm")
    system.add("a", fmu("degC", "a"))
    system.add("b", fmu("K", "b"))
    system.connect("a.y", "b.u")
    assert short(system)["b.y"] == pytest.approx([arrives] * 5, rel=1e-15)
    driven = short(alone(tmp_path / "b.fmu"), inputs={"a.u": Constant(5.0, "degC")})
    assert driven["a.y"] == pytest.approx([arrives] * 5, rel=1e-15)


# -- integers ------------------------------------------------------------------------------------


@pytest.mark.parametrize("type_", INTEGERS3)
def test_the_ends_of_every_integer_type(type_: str, tmp_path: Path) -> None:
    limits = np.iinfo(type_.lower())
    ends = [int(limits.min), int(limits.max)]
    system = pair(tmp_path, type_, type_)
    recording = short(system, inputs={"a.u": Table([0.0, 0.1], ends, extend=True)})
    assert shown(recording["b.y"]) == ends
    over = Table([0.0, 0.1], [ends[0], ends[1] + 1], extend=True)
    with pytest.raises(CosimError, match=f"{ends[1] + 1}.* does not fit type {type_}"):
        short(system, inputs={"a.u": over})


@pytest.mark.parametrize("isolate", [None, pytest.param(30.0, marks=pytest.mark.slow)])
def test_integers_of_64_bits_stay_exact_from_file_to_file(
    isolate: float | None, tmp_path: Path
) -> None:
    sent = Table([0.0, 0.1, 0.2], [BIG, BEYOND, -BIG - 1], extend=True)
    recording = short(pair(tmp_path, "Int64", "Int64"), inputs={"a.u": sent}, isolate=isolate)
    expected = [BIG, BEYOND, -BIG - 1]
    assert shown(recording["b.y"]) == expected
    read = read_recording(recording.write_parquet(tmp_path / "r.parquet"))
    assert read["b.y"].tolist() == recording["b.y"].tolist()
    rows = recording.write_csv(tmp_path / "r.csv").read_text().splitlines()
    column = rows[0].split(",").index("b.y")
    assert [row.split(",")[column] for row in rows[1:]] == list(map(str, recording["b.y"]))


@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel", "iterated", "adaptive"])
def test_every_algorithm_passes_exact_integers_and_texts(algorithm: str, tmp_path: Path) -> None:
    system = pair(tmp_path, "UInt64", "UInt64")
    system.add("c", str(passing(tmp_path, "String", name="c")))
    system.add("d", str(passing(tmp_path, "String", name="d")))
    system.connect("c.y", "d.u")
    recording = short(
        system, algorithm=algorithm,
        inputs={"a.u": Table([0.0, 0.2], [2**64 - 1, 2**64 - 2], extend=True), "c.u": "down"},
    )  # fmt: skip
    assert shown(recording["b.y"]) == [2**64 - 1, 2**64 - 2]
    assert recording["d.y"].tolist() == ["down"] * 5


def test_step_control_stops_where_an_input_changes_by_less_than_a_double_tells(tmp_path) -> None:
    sent = Table([0.0, 1.5], [2**64 - 1, 2**64 - 2], extend=True)
    system = pair(tmp_path, "UInt64", "UInt64")
    found = short(system, algorithm="adaptive", duration=3.0, inputs={"a.u": sent})
    expected = [2**64 - 1] * 15 + [2**64 - 2] * 16
    assert found["a.y"].tolist() == expected


def test_an_integer_that_a_double_does_not_carry_is_refused_with_both_ends(
    tmp_path: Path,
) -> None:
    system = pair(tmp_path, "Int64", "Float64")
    assert short(system, inputs={"a.u": 2**53})["b.y"].tolist() == [2.0**53] * 5
    with pytest.raises(StepError) as caught:
        short(system, inputs={"a.u": Table([0.0, 0.1], [1, BEYOND], extend=True)})
    assert f"a.y = {BEYOND} is not exact as a floating-point number, so it does not go to b.u" in (
        str(caught.value)
    )
    for inputs in ({"a.u": BEYOND}, {"a.u": Table([0.0], [BEYOND], extend=True)}):
        with pytest.raises(ValueRangeError, match=f"{BEYOND} is not exact as a floating-point"):
            short(alone(tmp_path / "target.fmu"), inputs=inputs)
    with pytest.raises(ValueRangeError, match=f"{BEYOND} is not exact as a floating-point"):
        alone(tmp_path / "target.fmu", {"u": BEYOND})
    with pytest.raises(ValueRangeError, match=r"0\.5 is no whole number, and type Int64"):
        alone(tmp_path / "source.fmu", {"u": 0.5})


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("executor", ["python", "auto"])
def test_a_real_number_becomes_an_integer_within_rounding_only(
    executor: str, fmi: int, tmp_path: Path
) -> None:
    system = pair(tmp_path, "Float64", "Int32", fmi)
    near = short(system, inputs={"a.u": 2.9999999999999996}, executor=executor)
    assert near["b.y"].tolist() == [3.0] * 5
    with pytest.raises(CosimError) as caught:
        short(system, inputs={"a.u": Table([0.0, 0.1], [1.0, 0.4], extend=True)}, executor=executor)
    assert "setting u from a.y: 0.4 is no whole number, and type Int32 carries nothing else" in (
        str(caught.value)
    )


@pytest.mark.parametrize("executor", ["python", "c"])
@pytest.mark.parametrize("type_", ["Int32", "UInt32"])
def test_integers_go_into_a_short_float_exactly_or_not_at_all(
    executor: str, type_: str, tmp_path: Path
) -> None:
    if executor == "c":
        build_kernel(kernel.SOURCES, kernel.cache_folder() / kernel.library_name(), host_platform())
    system = pair(tmp_path, type_, "Float32")
    most = 2**24
    assert short(system, inputs={"a.u": most}, executor=executor)["b.y"].tolist() == [most] * 5
    with pytest.raises(CosimError) as caught:
        short(
            system,
            inputs={"a.u": Table([0.0, 0.1], [most, most + 1], extend=True)},
            executor=executor,
        )
    text = "setting u from a.y: 16777217 is an integer that type Float32 does not carry exactly"
    assert text in str(caught.value)
    # a number with a unit or a fraction is rounded as ever
    system = System("scaled")
    system.add("a", str(tmp_path / "source.fmu"))
    system.add("b", str(tmp_path / "target.fmu"))
    system.connect("a.y", "b.u", factor=0.1)
    found = short(system, inputs={"a.u": most + 1}, executor=executor)
    assert found["b.y"].tolist() == [float(np.float32(0.1 * (most + 1)))] * 5


def test_an_integer_that_a_short_float_does_not_carry_is_no_parameter(tmp_path: Path) -> None:
    fmu = passing(tmp_path, "Float32")
    with pytest.raises(ValueRangeError, match="u: 16777217 is an integer that type Float32 does"):
        alone(fmu, {"u": 2**24 + 1})
    alone(fmu, {"u": 2**24 + 2})
    alone(fmu, {"u": 2.0**24 + 1.0})  # measured to 24 bits


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_truth_value_counts_as_a_number_without_a_unit(fmi: int, tmp_path: Path) -> None:
    on = Table([0.0, 0.1], [True, False], extend=True)
    for type_ in ("Float64", "Int32"):
        system = pair(tmp_path, "Boolean", type_, fmi)
        assert shown(short(system, inputs={"a.u": on})["b.y"]) == [1.0, 0.0]
    with pytest.raises(CosimError, match=r"Boolean2? do not fit: a number is neither true nor"):
        pair(tmp_path, "Float64", "Boolean", fmi)
    kelvin = V("u", "Float64", "input", "0", inner='unit="K"')
    warm = tiny(tmp_path, [kelvin], fmi=fmi, definitions=DEGREES, name="warm")
    system = System("warm")
    system.add("a", str(passing(tmp_path, "Boolean", fmi, "source")))
    system.add("b", str(warm))
    with pytest.raises(CosimError, match=r"do not fit: true is 1, and not 1 K; convert it"):
        system.connect("a.y", "b.u")


@pytest.mark.parametrize("fmi", [2, 3])
def test_truth_values(fmi: int, tmp_path: Path) -> None:
    system = pair(tmp_path, "Boolean", "Boolean", fmi)
    on = Table([0.0, 0.1], [True, False], extend=True)
    assert shown(short(system, inputs={"a.u": on})["b.y"]) == [1.0, 0.0]
    assert short(system, inputs={"a.u": True})["b.y"].tolist() == [1.0] * 5
    with pytest.raises(CosimError, match=r"2\.0 is neither true \(1\) nor false \(0\)"):
        short(system, inputs={"a.u": 2.0})


# -- texts, bytes, enumerations ------------------------------------------------------------------


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("isolate", [None, pytest.param(30.0, marks=pytest.mark.slow)])
def test_texts_are_set_driven_connected_and_recorded(
    isolate: float | None, fmi: int, tmp_path: Path
) -> None:
    system = pair(tmp_path, "String", "String", fmi)
    words = Table([0.0, 0.1], ["left", "grün, 100 %"], extend=True)
    recording = short(system, inputs={"a.u": words}, isolate=isolate)
    assert shown(recording["b.y"]) == ["left", "grün, 100 %"]
    assert read_recording(recording.write_parquet(tmp_path / "r.parquet"))["b.y"].tolist() == (
        recording["b.y"].tolist()
    )
    assert short(alone(tmp_path / "source.fmu", {"u": "kept"}))["a.y"].tolist() == ["kept"] * 5
    with pytest.raises(ValueRangeError, match=r"u = 3(\.0)? is not a string"):
        alone(tmp_path / "source.fmu", {"u": 3})
    with pytest.raises(CosimError, match="types String and Float64 do not fit"):
        pair(tmp_path, "String", "Float64", fmi)


def test_bytes(tmp_path: Path) -> None:
    system = pair(tmp_path, "Binary", "Binary")
    recording = short(system, inputs={"a.u": b"\x00\xff\x00"})
    assert recording["b.y"].tolist() == [b"\x00\xff\x00"] * 5
    assert short(system, inputs={"a.u": "00ff00"})["b.y"].tolist() == [b"\x00\xff\x00"] * 5
    assert read_recording(recording.write_parquet(tmp_path / "r.parquet"))["b.y"].tolist() == (
        recording["b.y"].tolist()
    )
    assert "00ff00" in recording.write_csv(tmp_path / "r.csv").read_text()
    with pytest.raises(ValueRangeError, match="neither bytes nor a string of hexadecimal digits"):
        short(system, inputs={"a.u": "xyz"})
    system.set("a.u", "0a0b")  # a parameter or start value goes into the file's provenance
    empty = short(system, record=[])
    for path in (empty.write_npz(tmp_path / "r.npz"), empty.write_parquet(tmp_path / "r.parquet")):
        found = read_recording(path).provenance["instances"]["a"]
        assert found["parameters"] == {"u": "0a0b"}


def mode(folder: Path, fmi: int) -> Path:
    """state = mode, an enumeration with gaps; k is tunable, c fixed."""
    ends = [
        V("mode", "Enumeration", "input", "1", inner='declaredType="Mode"'),
        V("state", "Enumeration", "output", inner='declaredType="Mode"'),
        V("k", "Float64", "parameter", "2", more='variability="tunable"'),
        V("y", "Float64", "output"),
        V("c", "Float64", "parameter", "1", more='variability="fixed"'),
    ]
    law = "v->n[1][0] = v->n[0][0]; v->r[3][0] = 10 * v->r[2][0];"
    begin = "v->n[0][0] = 1; v->r[2][0] = 2;"
    definitions = MODES2 if fmi == 2 else MODES3
    return tiny(folder, ends, law, fmi=fmi, begin=begin, definitions=definitions)


@pytest.mark.parametrize("fmi", [2, 3])
def test_enumerations_by_name_and_by_number(fmi: int, tmp_path: Path) -> None:
    fmu = mode(tmp_path, fmi)
    assert short(alone(fmu, {"mode": "fast"}))["a.state"].tolist() == [7.0] * 5
    assert short(alone(fmu, {"mode": 7}))["a.state"].tolist() == [7.0] * 5
    for given in (["off", "fast"], [1, 7]):
        driven = Table([0.0, 0.1], given, extend=True)
        assert shown(short(alone(fmu), inputs={"a.mode": driven})["a.state"]) == [1.0, 7.0]
    items = "is no item of its enumeration"
    with pytest.raises(ValueRangeError, match=rf"mode = 3 {items}: 1 \(off\), 2 \(slow\), 7 \(f"):
        alone(fmu, {"mode": 3})
    with pytest.raises(ValueRangeError, match=rf"'fats' {items}.*fast"):
        alone(fmu, {"mode": "fats"})
    with pytest.raises(ValueRangeError, match="mode = true is a truth value, and mode an enumera"):
        alone(fmu, {"mode": True})
    for given in (["off", "fats"], [1, 3], [1.0, 1.5]):
        with pytest.raises(ValueRangeError, match=r"input a\.mode from table"):
            short(alone(fmu), inputs={"a.mode": Table([0.0, 0.1], given, extend=True)})


@pytest.mark.parametrize("fmi", [2, 3])
def test_tunable_parameters_over_time(fmi: int, tmp_path: Path) -> None:
    system = alone(mode(tmp_path, fmi))
    recording = short(system, inputs={"a.k": Table([0.0, 0.1], [2.0, 5.0], extend=True)})
    assert shown(recording["a.y"]) == [20.0, 50.0]
    with pytest.raises(CosimError, match=r"a\.c is not an input .* variability 'fixed'"):
        short(system, inputs={"a.c": 1.0})


# -- arrays --------------------------------------------------------------------------------------


def vectors(folder: Path) -> Path:
    """y = A u with a matrix of two rows and three columns; `speed` is a second name of u."""
    variables = [
        V("u", "Float64", "input", "0 0 0", (3,), alias="speed"),
        V("y", "Float64", "output", size=(2,)),
        V("A", "Float64", "parameter", "1 2 3 4 5 6", (2, 3), 'variability="tunable"'),
        V("n", "Int64", "input", "0 0", (2,)),
        V("m", "Int64", "output", size=(2,)),
        V("words", "String", "output", size=(1,)),
    ]
    law = (
        "for (int i = 0; i < 2; i++) { v->r[1][i] = 0; v->n[4][i] = v->n[3][1 - i];"
        " for (int j = 0; j < 3; j++) v->r[1][i] += v->r[2][3 * i + j] * v->r[0][j]; }"
    )
    begin = "for (int i = 0; i < 6; i++) v->r[2][i] = i + 1;"
    return tiny(folder, variables, law, begin=begin)


def test_arrays_are_recorded_and_plotted_unasked(tmp_path: Path) -> None:
    recording = short(alone(vectors(tmp_path)), inputs={"a.u": 1.0})
    assert recording.names == ("a.y[1]", "a.y[2]", "a.m[1]", "a.m[2]", "a.words[1]")
    assert recording["a.y"].tolist() == [[6.0, 15.0]] * 5
    assert recording["a.y[2]"].tolist() == [15.0] * 5
    labels = [str(line.get_label()) for axes in recording.plot().axes for line in axes.get_lines()]
    assert {"a.y[1]", "a.y[2]", "a.m[1]"} <= set(labels)


@pytest.mark.parametrize("executor", ["python", "auto"])
@pytest.mark.parametrize(
    ("inputs", "expected"),
    [
        ({"a.u": [1.0, 0.0, 0.0]}, [1.0, 4.0]),
        ({"a.u[2]": 1.0}, [2.0, 5.0]),
        ({"a.u[1]": 1.0, "a.u[3]": 2.0}, [7.0, 16.0]),
        ({"a.u": [Table([0.0], [1.0], extend=True), 0.0, lambda t: 0.0 * t]}, [1.0, 4.0]),
    ],
)
def test_arrays_are_driven_whole_and_by_element(
    inputs: dict[str, Any], expected: list[float], executor: str, tmp_path: Path
) -> None:
    recording = short(alone(vectors(tmp_path)), inputs=inputs, executor=executor, record=["a.y"])
    assert recording["a.y"].tolist() == [expected] * 5


def test_exact_integers_in_arrays(tmp_path: Path) -> None:
    recording = short(alone(vectors(tmp_path)), inputs={"a.n": [BIG, BEYOND]})
    assert recording["a.m"].tolist() == [[BEYOND, BIG]] * 5


def test_arrays_are_connected_whole_and_by_element(tmp_path: Path) -> None:
    system = alone(vectors(tmp_path), {"A": [[1, 0, 0], [0, 1, 0]], "u": [3.0, 4.0, 0.0]})
    system.add("b", system.members["a"].reference)
    system.connect("a.y[2]", "b.u[1]")
    system.connect("a.m", "b.n")
    recording = short(system, inputs={"a.n[1]": BIG})
    assert recording["b.y"].tolist() == [[4.0, 16.0]] * 5
    assert recording["b.m"].tolist() == [[BIG, 0]] * 5
    with pytest.raises(CosimError, match=r"a\.y has 2 elements, b\.u has 3"):
        system.connect("a.y", "b.u")
    with pytest.raises(CosimError, match=r"b\.u\[1\] is already driven by a\.y\[2\]"):
        system.connect("a.y[1]", "b.u[1]")


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ([[1, 0, 0], [0, 1, 0]], [1.0, 1.0]),
        ([1, 1, 1, 2, 2, 2], [3.0, 6.0]),
        (1.0, [3.0, 3.0]),
        (np.eye(2, 3), [1.0, 1.0]),
    ],
)
def test_matrices_take_rows(value: Any, expected: list[float], tmp_path: Path) -> None:
    system = alone(vectors(tmp_path), {"A": value, "u": [1.0, 1.0, 1.0]})
    assert short(system)["a.y"].tolist() == [expected] * 5


@pytest.mark.parametrize("value", [[[1, 0, 0], [0, 1, 0]], [1, 0, 0, 0, 1, 0], np.eye(2, 3)])
def test_an_element_after_the_whole(value: Any, tmp_path: Path) -> None:
    system = alone(vectors(tmp_path), {"A": value, "u": [1.0, 1.0, 1.0]})
    system.set("a.A[2,1]", 9.0)
    assert short(system)["a.y"].tolist() == [[1.0, 10.0]] * 5
    system.set("a.A", 2.0)  # one for all
    system.set("a.A[1,3]", 0.0)
    assert short(system)["a.y"].tolist() == [[4.0, 6.0]] * 5


@pytest.mark.parametrize("written", [
    ('"a.A[2,1]" = 9.0\na.A = [[1, 0, 0], [0, 1, 0]]', ""),  # elements count wherever they stand
    ("a.A = [[1, 0, 0], [0, 1, 0]]", '"a.A[2,1]" = 9.0'),
    ('a.A = 7.0\n"a.A[1,1]" = 7.0', 'a.A = [[1, 0, 0], [9, 1, 0]]'),  # a whole, for all of it
])  # fmt: skip
def test_elements_and_wholes_in_files(written: tuple[str, str], tmp_path: Path) -> None:
    path = vectors(tmp_path)
    (tmp_path / "s.toml").write_text(
        f'[instances]\na = "{path}"\n[parameters]\n{written[0]}\n', encoding="utf-8"
    )
    (tmp_path / "run.toml").write_text(
        'system = "s.toml"\nduration = 0.2\nstep = 0.1\n[inputs]\n"a.u" = 1.0\n[parameters]\n'
        f"{written[1]}\n", encoding="utf-8",
    )  # fmt: skip
    recording = cosim.run(tmp_path / "run.toml").recording
    assert recording["a.y"][-1].tolist() == [1.0, 10.0]


def test_a_name_written_in_two_ways(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"a\.k is given twice, 1\.0 and 2\.0; keep one"):
        flatten({"a": {"k": 1.0}, "a.k": 2.0})
    assert flatten({"a": {"k": 1.0}, "a.l": 2.0}) == {"a.k": 1.0, "a.l": 2.0}


def test_an_element_of_a_matrix(tmp_path: Path) -> None:
    system = alone(vectors(tmp_path), {"A[2,1]": 9.0, "u": [1.0, 1.0, 1.0]})
    assert short(system)["a.y"].tolist() == [[6.0, 20.0]] * 5
    with pytest.raises(CosimError, match=r"no element 'A\[3,1\]': A goes from A\[1,1\] to A\[2,3"):
        system.set("a.A[3,1]", 1.0)
    with pytest.raises(ValueRangeError, match="A takes 2 x 3 values, but 3 x 2 are given; write"):
        system.set("a.A", [[1, 2], [3, 4], [5, 6]])
    with pytest.raises(ValueRangeError, match="its rows are not of one length"):
        system.set("a.A", [[1, 2, 3], [4, 5]])


def test_an_alias_is_the_variable_that_it_names(tmp_path: Path) -> None:
    system = alone(vectors(tmp_path))
    record = ["a.y", "a.speed", "a.u"]
    recording = short(system, inputs={"a.speed": 1.0}, record=record)
    assert recording["a.y"].tolist() == [[6.0, 15.0]] * 5
    assert recording["a.speed"].tolist() == recording["a.u"].tolist() == [[1.0] * 3] * 5
    with pytest.raises(GraphError, match=r"input a\.u\[2\] is given twice, as a\.speed\[2\], too"):
        short(system, inputs={"a.u": 1.0, "a.speed[2]": 2.0})
    system.add("b", system.members["a"].reference)
    system.connect("b.y[1]", "a.speed[1]")
    with pytest.raises(GraphError, match=r"a\.u\[1\] is already driven by b\.y\[1\]"):
        short(system, inputs={"a.u[1]": 1.0})
    system.set("b.speed", [1.0, 0.0, 0.0])
    system.set("b.u[2]", 1.0)
    assert short(system)["b.y"].tolist() == [[3.0, 9.0]] * 5


@pytest.mark.parametrize("fmi", [2, 3])
def test_scalars_that_count_from_zero_are_a_vector(fmi: int, tmp_path: Path) -> None:
    variables = [V(f"x[{k}]", "Float64", "input", "0") for k in range(3)]
    variables += [V(f"y[{k}]", "Float64", "output") for k in range(3)]
    law = "for (int k = 0; k < 3; k++) v->r[3 + k][0] = v->r[k][0];"
    fmu = tiny(tmp_path, variables, law, fmi=fmi)
    assert short(alone(fmu), inputs={"a.x": 7.0})["a.y"].tolist() == [[7.0] * 3] * 5
    assert short(alone(fmu, {"x": 7.0}))["a.y"].tolist() == [[7.0] * 3] * 5
    assert short(alone(fmu, {"x": [1.0, 2.0, 3.0]}))["a.y"].tolist() == [[1.0, 2.0, 3.0]] * 5
    assert short(alone(fmu), inputs={"a.x[0]": 7.0})["a.y"].tolist() == [[7.0, 0.0, 0.0]] * 5


@pytest.mark.parametrize(
    ("numbers", "told"),
    [((0, 2), r"has x\[0\] to x\[2\] and no x\[1\]"), ((1, 2, 4), r"no x\[3\]"),
     ((2, 3), r"no x\[1\]")],
)  # fmt: skip
def test_scalars_with_one_missing_are_no_vector(
    numbers: tuple[int, ...], told: str, tmp_path: Path
) -> None:
    """One value for all would set those before the gap."""
    variables = [V(f"x[{k}]", "Float64", "input", "0") for k in numbers]
    fmu = tiny(tmp_path, [*variables, V("y", "Float64", "output")])
    with pytest.raises(UnknownNameError, match=told):
        short(alone(fmu, {"x": 7.0}))
    with pytest.raises(UnknownNameError, match=told):
        short(alone(fmu), inputs={"a.x": 7.0})
    short(alone(fmu), inputs={f"a.x[{numbers[-1]}]": 7.0})


def test_structural_parameters_are_refused_in_one_sentence(tmp_path: Path) -> None:
    variables = [
        V("n", "UInt64", "structuralParameter", "3", more='variability="fixed"'),
        V("y", "Float64", "output"),
    ]
    system = alone(tiny(tmp_path, variables))
    with pytest.raises(GraphError, match=r"a\.n is a structural parameter; arrays have the sizes"):
        system.set("a.n", 2)
    with pytest.raises(CosimError, match="causality 'structuralParameter'"):
        short(system, inputs={"a.n": 2})
