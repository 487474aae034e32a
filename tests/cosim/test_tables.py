"""Scenarios, systems and studies with values of another kind: file, place, what it must be."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim.errors import InputError, ScenarioError
from cosim.files import read_toml
from cosim.scenario.scenario import read_scenario
from cosim.study.definition import read_study
from cosim.system.toml import read_system
from tests.small_fmus import fmi2, pack

SYSTEM = '[instances]\na = "a.fmu"\n'
SCENARIO = 'system = "s.toml"\nduration = 1.0\nstep = 0.1\n'
STUDY = 'scenario = "motor_bench"\n'


def refused(tmp_path: Path, read, content: str) -> str:
    (tmp_path / "s.toml").write_text(SYSTEM)
    path = tmp_path / "x.toml"
    path.write_text(content)
    with pytest.raises(InputError) as caught:
        read(path)
    text = str(caught.value)
    assert text.startswith(str(path))
    return text[len(str(path)) :]


def scenario(path: Path) -> None:
    file = read_scenario(path)
    for run in file.runs:
        file.scenario(run)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("duration = nan", "duration must be a finite number, not nan"),
        ("duration = 0x1" + "0" * 400, "duration must be a finite number, not 44462"),
        ("parameters = 5", "parameters must be a table, not 5"),
        ("variants = { a = 5 }", "variants a must be a text in quotes, not 5"),
        ("record = { signals = 5 }", "record: signals must be a list, not 5"),
        ("record = { signals = [5] }", "record: signals, entry 1, must be a text in quotes, not 5"),
        ("inputs = { u = 1979-05-27 }", "inputs u must be a value, a list of"),
        ("inputs = { u = [1, 1979-05-27] }", "inputs u must be a value, a list of"),
        ("inputs = { u = { file = 5 } }", "input u: file must be a text in quotes, not 5"),
        ("inputs = { u = { file = '' } }", "input u: file must be the path of a file, not ''"),
        ("inputs = { u = { times = 1, values = [1] } }", "input u: times must be a list, not 1"),
        ("compare = { u = 5 }", "compare u must be a table, not 5"),
        ("compare = { u = { signal = 'a', circle = { start = [1] } } }",
         "compare u: circle: start must be a list of 2, not [1]"),
        ("compare = { u = { signal = 'a', times = ['a'] } }", "times, entry 1, must be a number"),
        ("checks = 5", "checks must be a list, not 5"),
        ("checks = [5]", "checks, entry 1, must be a table, not 5"),
        ("checks = [{ limit = [1] }]", "limit must be a number, or two, not [1]"),
        ("checks = [{ after = 'a' }]", "after must be a number, not 'a'"),
        ("plots = [{ paths = [1] }]", "paths, entry 1, must be a list of 2, not 1"),
        ("plot = 5", "plot must be a list, not 5"),
        ("runs = { a = 5 }", "runs a must be a table, not 5"),
        ("runs = { a = { inputs = 5 } }", ", run a: inputs must be a table, not 5"),
        ("table = { file = 5, name = 'a' }", "[table]: file must be a text in quotes, not 5"),
        ("table = { file = 'a', name = 'a', join = 5 }", "[table]: join must be a table, not 5"),
        ("description = [5]", "description must be a text or a number, not [5]"),
        ("duration = 1e300\ncompare = { w = { signal = 'w', constant = 1 } }", "gives no times"),
    ],
)  # fmt: skip
def test_scenarios(tmp_path: Path, content: str, message: str) -> None:
    key = content.partition(" ")[0]
    rest = "".join(line + "\n" for line in SCENARIO.splitlines() if not line.startswith(key))
    assert message in refused(tmp_path, scenario, rest + content + "\n")


def test_a_table_that_is_not_there(tmp_path: Path) -> None:
    path = tmp_path / "x.toml"
    path.write_text(SCENARIO + '[table]\nfile = "/none.csv"\nname = "r"\n')
    with pytest.raises(ScenarioError, match=r"x\.toml: /none\.csv: there is no such file"):
        read_scenario(path)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("a,b\n1\n", "table.csv: row 1 has more or fewer cells than the head"),
        ("a,b\n1,2,3\n", "table.csv: row 1 has more or fewer cells than the head"),
        ('a,b\n1,"' + "x" * 200_000 + '"\n', "table.csv: is not a CSV table in UTF-8"),
        ("a,b\n1,\xff\n", "table.csv: is not a CSV table in UTF-8"),
    ],
)
def test_tables_of_runs(tmp_path: Path, table: str, message: str) -> None:
    (tmp_path / "table.csv").write_bytes(table.encode("latin-1"))
    path = tmp_path / "x.toml"
    path.write_text(SCENARIO + '[table]\nfile = "table.csv"\nname = "r{a}"\n')
    with pytest.raises(ScenarioError) as caught:
        read_scenario(path)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("name", "table", "join", "message"),
    [
        ("SET{a}", "a,b\n1,1\n1,2\n", "", "'SET{a}' gives 'SET1' in rows 1 and 2; make"),
        ("{a}", "a,b\n,1\n", "", "gives nothing in row 1; fill the cell"),
        ("{a}", "a,b\n", "", "table.csv: has no rows, so there are no runs"),
        ("{a}", "a,b\n1,1\n", "a,c\n1,5\n2,5\n1,6\n", "join.csv: a = '1' in rows 1 and 3; make"),
        ("{a}", "a,b\n1,1\n", "a,c\n01,5\n", "join.csv: has no row with a = 1"),
    ],
)
def test_no_row_of_a_table_is_lost(
    tmp_path: Path, name: str, table: str, join: str, message: str
) -> None:
    (tmp_path / "table.csv").write_text(table)
    (tmp_path / "join.csv").write_text(join)
    path = tmp_path / "x.toml"
    joined = 'join = { file = "join.csv", on = "a" }\n' if join else ""
    path.write_text(SCENARIO + f'[table]\nfile = "table.csv"\nname = "{name}"\n{joined}')
    with pytest.raises(ScenarioError) as caught:
        read_scenario(path)
    assert message in str(caught.value)


def test_names_that_look_like_numbers_stay_names(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(SYSTEM)
    (tmp_path / "log.csv").write_text("time,1,01\n0,5,7\n1,5,7\n")
    (tmp_path / "table.csv").write_text("a,k\n1,10\n01,20\n1e0,1_5\n")
    path = tmp_path / "x.toml"
    path.write_text(
        SCENARIO + 'parameters.a.time = "{k}"\n[table]\nfile = "table.csv"\nname = "{a}"\n'
        '[compare.x]\nsignal = "a.y"\nfile = "log.csv"\ncolumn = "{a}"\nscale = "{k}"\n'
    )
    file = read_scenario(path)
    assert list(file.runs) == ["1", "01", "1e0"]
    for run, value, k in (("1", 5.0, 10.0), ("01", 7.0, 20.0)):
        read = file.scenario(run)
        assert read.parameters == {"a.time": k}  # a parameter's name, no key of a scenario
        assert read.references["x"].values[0, 0] == k * value
    with pytest.raises(ScenarioError, match="scale must be a number, not '1_5'"):
        file.scenario("1e0")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("name = 5", "name must be a text in quotes, not 5"),
        ("connections = 5", "connections must be a list, not 5"),
        ("parameters = 5", "parameters must be a table, not 5"),
        ("[instances]\na = 5", "instance 'a' must be a variant or the path of an .fmu, not 5"),
    ],
)
def test_systems(tmp_path: Path, content: str, message: str) -> None:
    whole = content if "instances" in content else f"{content}\n{SYSTEM}"
    assert message in refused(tmp_path, read_system, whole)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("set = 5", "[set] must be a table, not 5"),
        ("param = [5]", "[param] must be a table, not [5]"),
        ("step = 0x1" + "0" * 400, "must be finite"),
        ("repeats = 1000001", "repeats = 1000001 is more than the most, 1000000"),
        ("param = { x = { from = 1e-300, to = 1e300, count = 3, scale = 'log' } }",
         "goes from 1e-300 to 1e+300, too far for one range"),
        ("reference = 'finest'\nstep = [[1], [1]]", '"finest" needs a list of at least two steps'),
    ],
)  # fmt: skip
def test_studies(tmp_path: Path, content: str, message: str) -> None:
    assert message in refused(tmp_path, read_study, f"{STUDY}{content}\n")


def test_toml_that_harms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "x.toml"
    for content, message in (
        (b"a = " + b"[" * 10_000, r"lie too deep within each other"),
        (b".".join([b"a"] * 100) + b" = 1", r"lie more than 40 deep"),
        (b"a = " + b"1" * 5000, r"is not TOML \(Exceeds the limit"),
        (b"a = '\xff'", r"is not TOML \('utf-8' codec"),
    ):
        path.write_bytes(content)
        with pytest.raises(ScenarioError, match=message):
            read_toml(path)
    monkeypatch.setenv("COSIM_MAX_TEXT", "5")
    with pytest.raises(ScenarioError, match=r"more than the limit of 5 bytes.*COSIM_MAX_TEXT"):
        read_toml(path)
    with pytest.raises(ScenarioError, match="is not TOML"):
        read_toml(Path("a\0b.toml"))


def test_whole_numbers_beyond_floating_point(tmp_path: Path) -> None:
    (tmp_path / "a.fmu").write_bytes(pack(tmp_path / "b.fmu", fmi2()).read_bytes())
    path = tmp_path / "x.toml"
    path.write_text(f"{SYSTEM}[parameters]\n'a.u' = 0x1{'0' * 400}\n")
    with pytest.raises(InputError, match=r"x\.toml: x: a: u = 444624\d+ … is not finite"):
        read_system(path).build(None)
