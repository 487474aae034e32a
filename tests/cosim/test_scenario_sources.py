"""Where scenarios take inputs and references from: clocks, holds, units, kinds of values."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim import Constant, Master, System, Table, read_recording
from cosim.data.comparison import compare
from cosim.data.recording import Recording
from cosim.errors import InputError
from cosim.fmu.check import check
from cosim.running.runner import RunResult, run
from tests.tiny_fmus import V, tiny

PASS = [V("u", "Float64", "input", "0"), V("y", "Float64", "output")]
"""Its output is its input."""


def ran(folder: Path, text: str, base: str = "duration = 1.0\nstep = 0.1\n") -> RunResult:
    """Run a scenario of one instance `a` of the FMU `m`."""
    (folder / "s.toml").write_text('[instances]\na = "m.fmu"\n')
    (folder / "c.toml").write_text(f'system = "s.toml"\n{base}{text}')
    return next(iter(run(str(folder / "c.toml")).runs.values()))


@pytest.fixture
def passing(tmp_path: Path) -> Path:
    tiny(tmp_path, PASS, "v->r[1][0] = v->r[0][0];")
    return tmp_path


# -- clocks --------------------------------------------------------------------------------------

FROM_LOG = """
record = { signals = ["a.u"] }
inputs."a.u" = { file = "FILE", column = "u", interpolation = "linear" }
compare.c = { signal = "a.u", file = "FILE", column = "u" }
"""


def log(folder: Path, kind: str) -> str:
    """A log of u = t over one second, whose clock does not count seconds; its name."""
    u, tenths = 0.1 * np.arange(11), np.arange(11)
    if kind.startswith("time"):
        one = {"ms": 100.0, "us": 1e5, "min": 1 / 600}[kind[6:-1]]
        rows = "".join(f"{one * i!r},{0.1 * i!r}\n" for i in range(11))
        (folder / "log.csv").write_text(f"{kind},u\n{rows}")
        return "log.csv"
    if kind == "npz":
        np.savez(folder / "log.npz", time=(100 * tenths).astype("timedelta64[ms]"), u=u)
        return "log.npz"
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    times = pa.array((100_000_000 * tenths).astype("int64"), pa.duration("ns"))
    pq.write_table(pa.table({"time": times, "u": u}), folder / "log.parquet")
    return "log.parquet"


@pytest.mark.parametrize("kind", ["time [ms]", "time [us]", "time [min]", "npz", "parquet"])
def test_the_unit_of_a_clock_is_taken_in(kind: str, passing: Path) -> None:
    result = ran(passing, FROM_LOG.replace("FILE", log(passing, kind)))
    recording: Recording = result.recording
    assert recording["a.u"] == pytest.approx(recording.time, abs=1e-12)  # roundings of ten steps
    assert result.comparisons["c"].count == 11
    assert result.comparisons["c"].max == pytest.approx(0.0, abs=1e-12)


def test_stamps_since_1970_keep_their_origin(passing: Path) -> None:
    begin = 1_700_000_000
    rows = "".join(f"{(begin * 10 + i) * 100_000_000},{0.1 * i!r}\n" for i in range(11))
    (passing / "log.csv").write_text(f"time [ns],u\n{rows}")
    text = FROM_LOG.replace("FILE", "log.csv")
    with pytest.raises(InputError, match=r"covers 1700000000 s to 1700000001 s, .* start it where"):
        ran(passing, text)
    with pytest.raises(InputError, match=r"no sample lies .*they are at 1700000000 s"):
        ran(passing, text[text.index("compare") :])
    result = ran(passing, f"start = {begin}\n{text}")
    late = result.recording["a.u"] - (result.recording.time - begin)
    assert abs(late).max() < 1e-6  # a double of 1.7e9 s has steps of 2.4e-7 s
    assert result.comparisons["c"].count == 11


def test_a_clock_that_is_no_time_is_refused(passing: Path) -> None:
    (passing / "log.csv").write_text("time [m],u\n0,0\n1,1\n")
    with pytest.raises(InputError, match="clock 'time' is in 'm', which is no time"):
        ran(passing, FROM_LOG.replace("FILE", "log.csv"))


# -- what is held --------------------------------------------------------------------------------


def test_commands_that_are_logged_when_they_change_do_not_come_early(passing: Path) -> None:
    times = [0.0, 10.0, 20.0, 20.004, 20.008, 30.0, 40.0]
    values = [0.0, 1.0, 0.0, 5.0, 0.0, 1.0, 0.0]
    rows = "".join(f"{t},{v}\n" for t, v in zip(times, values, strict=True))
    (passing / "log.csv").write_text(f"time,u\n{rows}")
    text = 'inputs."a.u" = { file = "log.csv", column = "u" }\nrecord = { signals = ["a.u"] }\n'
    recording = ran(passing, text, "duration = 40.0\nstep = 1e-3\n").recording
    changes = np.flatnonzero(np.diff(recording["a.u"])) + 1
    assert changes.tolist() == [10_000, 20_000, 20_004, 20_008, 30_000, 40_000]


# -- windows -------------------------------------------------------------------------------------

WINDOW = """
[[checks]]
name = "NAME"
signal = "a.u"
of = "NAME"
limit = [0.29, 0.31]
"""
RAMP = 'inputs."a.u" = { times = [0.0, 1.0], values = [0.0, 1.0], interpolation = "linear" }\n'


@pytest.mark.parametrize("start", [0.0, 1.7e9])
def test_windows_take_their_ends_in(start: float, passing: Path) -> None:
    # 3 * 0.1 is 0.30000000000000004; at 1.7e9 s a double has steps of 2.4e-7 s
    ramp = RAMP.replace("[0.0, 1.0], values", f"[{start}, {start + 1.0}], values")
    window = WINDOW.replace("NAME", "final") + f"before = {start + 0.3}\n"
    window += WINDOW.replace("NAME", "initial") + f"after = {start + 0.3}\n"
    result = ran(passing, ramp + window, f"start = {start}\nduration = 0.9\nstep = 0.1\n")
    assert [check.measured for check in result.checks] == pytest.approx([0.3, 0.3], abs=1e-6)
    assert all(check.ok for check in result.checks)


@pytest.mark.parametrize(("period", "said"), [(0.3, True), (0.5, False)])
def test_an_end_that_is_not_recorded_is_noted(period: float, said: bool, passing: Path) -> None:
    result = ran(passing, RAMP + f"record = {{ period = {period} }}\n")
    assert any("the last recorded point is at 0.9 s" in note for note in result.notes) == said


# -- units ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("unit", ['<Unit name="RPM"/>', ""])
def test_a_unit_that_is_only_named_is_read_by_its_name(unit: str, fmi: int, tmp_path: Path) -> None:
    definition = f"<UnitDefinitions>{unit}</UnitDefinitions>"
    named = 'unit="RPM"'
    giver = [V("y", "Float64", "output", inner=named), V("u", "Float64", "input", "0", inner=named)]
    taker = [V("u", "Float64", "input", "0", inner='unit="rad/s"'), V("y", "Float64", "output")]
    definitions = (
        '<UnitDefinitions><Unit name="rad/s"><BaseUnit rad="1" s="-1"/></Unit></UnitDefinitions>'
    )
    system = System("two")
    for name, variables, law, said in (
        ("a", giver, "v->r[0][0] = 600 + 0 * v->r[1][0];", definition),
        ("b", taker, "v->r[1][0] = v->r[0][0];", definitions),
    ):
        path = tiny(tmp_path, variables, law, fmi=fmi, name=name, definitions=said)
        system.add(name, str(path))
    system.connect("a.y", "b.u")
    recording = Master(system, step=0.1).run(
        0.5, inputs={"a.u": Constant(10.0, "rad/s")}, record=["b.u", "a.u"]
    )
    assert recording["b.u"][-1] == pytest.approx(600 * np.pi / 30, rel=1e-12)
    assert recording["a.u"][-1] == pytest.approx(10 * 30 / np.pi, rel=1e-12)
    assert recording.units["a.u"] == "RPM"


def test_a_unit_that_nobody_can_convert_is_noted(passing: Path) -> None:
    result = ran(passing, 'inputs."a.u" = { constant = 10.0, unit = "rpm" }\n')
    assert any(
        "a.u takes 10 rpm as it is: it is in 'rpm', and the FMU declares no unit" in note
        for note in result.notes
    )
    assert not ran(passing, 'inputs."a.u" = { constant = 10.0 }\n').notes


@pytest.mark.parametrize(("unit", "said"), [("furlong", True), ("rpm", False)])
def test_a_unit_whose_name_says_nothing_is_found(unit: str, said: bool, tmp_path: Path) -> None:
    defined = f'<UnitDefinitions><Unit name="{unit}"/></UnitDefinitions>'
    inner = f'unit="{unit}"'
    path = tiny(tmp_path, [V("y", "Float64", "output", inner=inner)], definitions=defined)
    found = [item for item in check(path) if "no BaseUnit" in item.text]
    assert bool(found) == said


FOREIGN = [
    # unit of the FMU, its definition, its value; the same in a unit of ours
    ("degC", 'K="1" offset="273.15"', 5.0, 5.0, "K", 'relativeQuantity="true"'),
    ("Nm", 'kg="1" m="2" s="-2"', 5.0, 5.0, "N.m", ""),
    ("Nm", 'kg="1" m="2" s="-2"', 5.0, 5.0, "Nm", ""),
    ("rev/min", 's="-1" factor="0.016666666666666666"', 600.0, 10.0, "Hz", ""),
    ("C", 'K="1" offset="273.15"', 26.85, 300.0, "K", ""),
    ("t", 'kg="1" factor="907.18474"', 1.0, 907.18474, "kg", ""),  # the short ton
    ("t", 'kg="1" factor="907.18474"', 1.0, 1.0, "t", ""),
]
COMPARED = """
inputs."a.u" = { constant = VALUE, unit = "UNIT" }
compare.c = { signal = "a.y", constant = VALUE, unit = "UNIT" }
compare.d = { signal = "a.u", constant = VALUE, unit = "UNIT" }
plots = [{ label = "y", signals = ["a.y"], unit = "UNIT" },
         { label = "difference", comparisons = ["c"], unit = "UNIT" }]
"""


@pytest.mark.parametrize(("unit", "base", "own", "value", "given", "more"), FOREIGN)
def test_comparisons_take_a_unit_as_the_fmu_defines_it(
    unit: str, base: str, own: float, value: float, given: str, more: str, tmp_path: Path
) -> None:
    inner = f'unit="{unit}" {more}'
    defined = f'<Unit name="{unit}"><BaseUnit {base}/></Unit>'
    tiny(
        tmp_path,
        [V("u", "Float64", "input", "0", inner=inner), V("y", "Float64", "output", inner=inner)],
        f"v->r[1][0] = {own};",
        definitions=f"<UnitDefinitions>{defined}</UnitDefinitions>",
    )
    text = COMPARED.replace("VALUE", str(value)).replace("UNIT", given)
    result = ran(tmp_path, text + 'record = { signals = ["a.u", "a.y"] }\n')
    kept = read_recording(result.recording.keep(tmp_path / "kept"))
    for recording in (result.recording, kept):  # the sum with 273.15 rounds
        for item in ("c", "d"):
            found = compare(recording, result.scenario.references[item])
            assert found.max == pytest.approx(0.0, abs=1e-12), item
            assert found.count == 11
    shown, apart = (axis.lines[0].get_ydata() for axis in result.plot().axes)
    assert shown == pytest.approx(np.full(11, value), rel=1e-12)
    assert apart == pytest.approx(np.zeros(11), abs=1e-12)


def test_what_is_subtracted_comes_in_the_unit_of_the_signal(tmp_path: Path) -> None:
    units = "".join(
        f'<Unit name="{name}"><BaseUnit m="1" factor="{factor}"/></Unit>'
        for name, factor in (("m", 1), ("mm", 1e-3))
    )
    tiny(
        tmp_path,
        [
            V("a", "Float64", "output", inner='unit="m"'),
            V("b", "Float64", "output", inner='unit="mm"'),
        ],
        "v->r[0][0] = 2.0; v->r[1][0] = 500.0;",
        definitions=f"<UnitDefinitions>{units}</UnitDefinitions>",
    )
    text = """
    plots = [{ label = "apart", signals = ["a.a"], minus = "a.b" }]
    [[checks]]
    name = "apart"
    signal = "a.a"
    minus = "a.b"
    of = "final"
    limit = [1.499, 1.501]
    """
    result = ran(tmp_path, text)
    assert result.checks[0].measured == pytest.approx(1.5, rel=1e-12)
    assert result.plot().axes[0].lines[0].get_ydata() == pytest.approx(np.full(11, 1.5))


# -- kinds of values -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("driver", "end"),
    [
        (np.sin, np.sin(1.0)), (np.int64(3), 3.0), (np.float32(3.5), 3.5), (np.array(3.0), 3.0),
        (np.bool_(True), 1.0), (Fraction(1, 2), 0.5), (lambda t: 2, 2.0),
    ],
)  # fmt: skip
def test_numbers_and_functions_of_numpy_drive_inputs(driver, end: float, passing: Path) -> None:
    system = System("one")
    system.add("a", str(passing / "m.fmu"))
    recording = Master(system, step=0.1).run(1.0, inputs={"a.u": driver}, record=["a.u"])
    assert recording["a.u"][-1] == pytest.approx(end, rel=1e-12)


class Series:
    """As one of pandas: its `at` is no function."""

    at = ()


@pytest.mark.parametrize(
    ("driver", "message"),
    [
        (math.sin, r"built-in function sin> does not give .* take numpy's functions \(np\.sin"),
        (lambda t: np.ones((t.size, 1)), "does not give one number per time"),
        (lambda t: 1j * t, "it returns complex numbers"),
        (lambda t: "x", "does not give one number per time"),
        (Series(), "what drives an input must be a signal, a number, a text or a function"),
        pytest.param(2**2000, "is not finite", id="large"),
        (3j, "what drives an input must be"),
    ],
)  # fmt: skip
def test_what_drives_no_input_is_named(driver, message: str, passing: Path) -> None:
    system = System("one")
    system.add("a", str(passing / "m.fmu"))
    with pytest.raises(InputError, match=message):
        Master(system, step=0.1).run(1.0, inputs={"a.u": driver})


@pytest.mark.parametrize(
    "values", [["a", 1], [1.5, "on"], [2**2000, 1]], ids=["text first", "text last", "large"]
)
def test_a_table_is_of_one_kind(values: list[Any]) -> None:
    with pytest.raises(InputError, match="neither all numbers nor all texts"):
        Table([0.0, 1.0], values)


def test_a_table_keeps_its_values() -> None:
    times, values = np.array([0.0, 1.0]), np.array([1.0, 2.0])
    table = Table(times, values)
    times[:], values[:] = 7.0, 99.0
    assert table.at(np.array([0.0, 1.0])).tolist() == [1.0, 2.0]


def test_a_file_without_a_column_lists_its_own(passing: Path) -> None:
    (passing / "log.csv").write_text("time,v\n0,0\n1,1\n")
    with pytest.raises(InputError, match=r"input a.u: column is missing; there is time, v"):
        ran(passing, 'inputs."a.u" = { file = "log.csv" }\n')


CHECK = 'checks = [{ name = "c", signal = "SIGNAL", of = "final", limit = 1.0 MORE }]\n'


@pytest.mark.parametrize(
    ("text", "what"),
    [
        (CHECK.replace("SIGNAL", "a.s").replace("MORE", ""), "check 'c'"),
        (CHECK.replace("SIGNAL", "a.y").replace("MORE", ', minus = "a.s"'), "check 'c'"),
        ('compare.x = { signal = "a.s", constant = 1.0 }\n', "compare x"),
        ('plots = [{ label = "p", signals = ["a.s"] }]\n', "plot 'p'"),
        ('plots = [{ label = "p", signals = ["a.y"], minus = "a.s" }]\n', "plot 'p'"),
    ],
)
def test_texts_are_neither_measured_nor_drawn(text: str, what: str, tmp_path: Path) -> None:
    variables = [V("s", "String", "output"), V("y", "Float64", "output")]
    tiny(tmp_path, variables, 'strcpy(v->s[0], "hi"); v->r[1][0] = v->t;')
    with pytest.raises(InputError, match=f"{what} takes a.s, which is of type String"):
        ran(tmp_path, text)
    assert ran(tmp_path, 'plot = ["a.y", "a.s"]\n').plot() is not None  # it is left out
