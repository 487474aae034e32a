"""The command line: exact JSON keys, exit codes, one clear error per bad input, no half files."""

from __future__ import annotations

import json
import sys
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from cosim.cli import app as cli
from cosim.spec.distribution import version
from tests.cosim_fmus import rewrite
from tests.fmus import fmu


@dataclass(frozen=True)
class Outcome:
    code: int
    out: str
    err: str


Command = Callable[..., Outcome]


@pytest.fixture
def command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> Command:
    def call(*arguments: object) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["cosim", *map(str, arguments)])
        monkeypatch.chdir(tmp_path)
        code = 0
        try:
            cli.main()
        except SystemExit as end:
            code = int(end.code or 0)
        captured = capsys.readouterr()
        return Outcome(code, captured.out, captured.err)

    return call


def test_help_of_every_command_has_an_example(command: Command) -> None:
    for words in (["fmus", "list"], ["fmus", "build"], ["fmus", "check"], ["scenarios"], ["run"]):
        done = command(*words, "--help")
        assert done.code == 0 and f"cosim {' '.join(words)}" in " ".join(done.out.split())
        assert "Example" in done.out


@pytest.mark.slow
def test_fmus_list_by_component(command: Command) -> None:
    done = command("fmus", "list")
    assert done.code == 0
    for words in ("gearbox", "ratio, lossy, elastic", "Reduction gearbox between a motor and its"):
        assert words in done.out
    assert "+backlash" not in done.out and "cosim fmus list COMPONENT" in done.err


def test_fmus_list_filtered(command: Command) -> None:
    done = command("fmus", "list", "gearbox", "--filter", "backlash", "--json")
    assert [entry["variant"] for entry in json.loads(done.out)] == ["gearbox/elastic+backlash"]


def test_fmus_list_json(command: Command) -> None:
    done = command("fmus", "list", "gearbox", "--json")
    entries = json.loads(done.out)
    assert done.code == 0 and {entry["component"] for entry in entries} == {"gearbox"}
    for entry in entries:
        assert list(entry) == [
            "variant", "component", "fidelity", "effects", "inputs", "outputs", "parameters",
            "states", "description",
        ]  # fmt: skip
    assert "gearbox/ratio" in [entry["variant"] for entry in entries]


def test_fmus_build_and_check(command: Command, tmp_path: Path) -> None:
    done = command("fmus", "build", "gearbox/ratio", "--out", tmp_path / "f", "--json")
    (built,) = json.loads(done.out)["built"]
    assert done.code == 0 and Path(built["file"]).is_file()
    done = command("fmus", "check", built["file"], "--json")
    assert done.code == 0
    assert json.loads(done.out) == {
        "checked": 1, "with_problems": 0, "problems": {built["file"]: []},
    }  # fmt: skip


def test_fmus_check_finds_problems(command: Command, tmp_path: Path) -> None:
    bad = rewrite(
        fmu("gearbox/ratio"), tmp_path / "bad.fmu", xml=lambda text: text.replace('unit="N.m"', "")
    )
    broken = tmp_path / "broken.fmu"
    broken.write_bytes(bad.read_bytes()[:500])
    done = command("fmus", "check", bad, broken)
    assert done.code == 1 and "2 of 2 FMUs have problems" in done.err
    assert "has no unit" in done.out and "is not a complete FMU archive" in done.out
    done = command("fmus", "check", bad, "--json")
    content = json.loads(done.out)
    (finding,) = [item for item in content["problems"][str(bad)] if item["variable"] == "tau_a"]
    with zipfile.ZipFile(bad) as archive:
        lines = archive.read("modelDescription.xml").decode().splitlines()
    line = next(i for i, text in enumerate(lines, 1) if 'name="tau_a"' in text)
    assert finding == {
        "severity": "error", "file": "modelDescription.xml", "line": line, "variable": "tau_a",
        "problem": "has no unit", "way_out": "build it again with 'cosim fmus build'",
    }  # fmt: skip
    assert (content["checked"], content["with_problems"]) == (1, 1)


def test_scenarios_json(command: Command) -> None:
    entries = json.loads(command("scenarios", "--json").out)
    bench = next(entry for entry in entries if entry["name"] == "motor_bench")
    assert bench["kind"] == "scenario" and bench["system"] == "motor_bench" and bench["runs"]
    kinds = {entry["kind"] for entry in entries}
    assert kinds == {"scenario", "logs", "study", "public logs"}
    for entry in entries:
        assert entry["description"], entry
        if entry["kind"] == "public logs":
            assert entry["origin"] and Path(entry["readme"]).is_file()


def test_scenarios_says_how_each_kind_is_run(command: Command) -> None:
    text = " ".join(command("scenarios").out.split())
    for words in ("cosim run NAME", "cosim diagnose NAME", "cosim study NAME", "--mapping NAME"):
        assert words in text
    for name in ("motor_bench", "MB-13", "tolerances", "emps/open_loop", "crawler_bench"):
        assert f"│ {name} " in text


def test_version_is_that_of_the_distribution(command: Command) -> None:
    done = command("--version")
    assert done.code == 0 and done.out == f"cosim {version()} (cosim-robotics)\n"


def test_run_json(command: Command, tmp_path: Path) -> None:
    done = command(
        "run", "motor_bench/ST1", "--json", "--step", "1e-3", "--duration", "0.1",
        "--set", "gearbox=lossy", "--param", "load.J=0.09", "--out", "results",
    )  # fmt: skip
    assert done.code == 0, done.err
    content = json.loads(done.out)
    assert list(content) == [
        "scenario", "variants", "algorithm", "step", "simulated_s", "wall_s", "fmu_steps",
        "energy_residual_J", "comparison", "checks", "notes", "files",
    ]  # fmt: skip
    assert content["scenario"] == "motor_bench/ST1" and content["step"] == 1e-3
    assert content["variants"]["gearbox"] == "gearbox.lab_bench/lossy"
    assert all((tmp_path / path).is_file() for path in content["files"])


def test_run_for_people(command: Command) -> None:
    done = command("run", "motor_bench/ST1", "--step", "1e-3", "--duration", "0.1")
    assert (
        done.code == 0 and "the coupling invented" in done.out and "out/motor_bench/ST1" in done.out
    )


def test_run_with_ready_fmus_only(command: Command) -> None:
    for name in ("dc_motor.lab_bench/sampled", "gearbox.lab_bench/ratio", "inertia.lab_bench/disc",
                 "encoder.motor_bench/counts"):  # fmt: skip
        folder = fmu(name).parent.parent
    done = command(
        "run", "motor_bench/ST1", "--fmus", folder, "--step", "1e-3", "--duration", "0.1", "--json"
    )
    assert done.code == 0 and json.loads(done.out)["fmu_steps"] == 400


RUN = ["run", "motor_bench/ST1", "--step", "1e-3", "--duration", "0.1", "--out", "results"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([*RUN, "--set", "gearbox=rubber"], "there is no fidelity of 'gearbox' called 'rubber'"),
        ([*RUN, "--set", "gearbox=+rust"], "there is no effect 'rust'"),
        ([*RUN, "--set", "gearbox=gearbix/ratio"], "there is no component 'gearbix'"),
        ([*RUN, "--set", "gearbox=+winding_heating"], "fits no balance of gearbox/ratio"),
        ([*RUN, "--set", "gearbox=+coulomb@nowhere"], "fits no balance of gearbox/ratio"),
        ([*RUN, "--set", "gearbax=elastic"], "'gearbax' is no instance, component or slot"),
        ([*RUN, "--set", "gearbox"], "write --set INSTANCE=VARIANT"),
        ([*RUN, "--param", "gearbox.eta=7"], "gearbox: eta = 7 is outside its bounds [0.1, 1]"),
        ([*RUN, "--param", "gearbox.eta=NaN"], "gearbox: eta = nan is not finite"),
        ([*RUN, "--param", "gearbox.eta=much"], "gearbox: eta = 'much' is not a number"),
        ([*RUN, "--param", "gearbox.eata=1"], "no variable 'eata'; did you mean 'eta'"),
        ([*RUN, "--param", "gearbox.eta"], "write --param INSTANCE.NAME=VALUE"),
        ([*RUN, "--algorithm", "jacoby"], "there is no algorithm 'jacoby'; did you mean 'jacobi'"),
        ([*RUN, "--fmus", "nowhere"], "--fmus nowhere: there is no such folder"),
        ([*RUN, "--set", "gearbox=lost.fmu"], "lost.fmu: there is no such file"),
        ([*RUN, "--set", "gearbox=cut.fmu"], "cut.fmu: is not a complete FMU archive"),
        ([*RUN, "--set", "gearbox=plan9.fmu"], "has no binary for this machine"),
        ([*RUN, "--set", "gearbox=short.fmu"], "is cut short: 2000 bytes of at least"),
        ([*RUN, "--set", "load=volts.fmu"], "unit 'N.m' (SI kg.m2.s-2) does not convert"),
        (["run", "motor_bensh"], "there is no scenario 'motor_bensh'; did you mean 'motor_bench'"),
        (["run", "motor_bench/XX"], "ST1, MX1 as run, not 'XX'"),
        (["run", "motor_bench/ST1", "--step", "0"], "communication step 0.0 s is not positive"),
        (["fmus", "build", "gearbox/rubber", "--out", "results"], "called 'rubber'"),
        (["fmus", "build", "gearbox/ratio", "--out", "cut.fmu"], "choose another folder"),
        (["linearize", "motor_bench/ST1", "--out", "cut.fmu/x"], "choose another folder"),
        (["fmus", "build", "gearbox_", "--out", "results"],
         "no component 'gearbox_'; did you mean 'gearbox'"),
        (["fmus", "build", "gearbox/ratio", "--kind", "python", "--fmi", "3", "--out", "results"],
         "python FMUs are FMI 2.0 only"),
        (["fmus", "check", "lost.fmu"], "lost.fmu: there is no such file"),
        (["fmus", "list", "gearbax"], "did you mean 'gearbox'?"),
    ],
)  # fmt: skip
def test_bad_input(command: Command, tmp_path: Path, arguments: list[str], message: str) -> None:
    source = fmu("gearbox.lab_bench/ratio")
    (tmp_path / "cut.fmu").write_bytes(source.read_bytes()[:3000])
    rewrite(source, tmp_path / "plan9.fmu", keep=lambda name: not name.startswith("binaries"))
    rewrite(source, tmp_path / "short.fmu", limit=2000)
    rewrite(
        fmu("inertia.lab_bench/disc"), tmp_path / "volts.fmu",
        xml=lambda text: text.replace('unit="N.m"', 'unit="rad/s"'),
    )  # fmt: skip
    before = sorted(tmp_path.rglob("*"))
    done = command(*arguments)
    assert done.code == 2
    assert done.out == ""
    assert message in done.err and "Traceback" not in done.err
    assert sorted(tmp_path.rglob("*")) == before  # nothing written


@pytest.mark.parametrize(
    "arguments",
    [["run"], ["runn"], ["run", "x", "--stepp", "1"], ["run", "x", "--step", "y"],
     ["fmus", "build", "--fmi", "4"], ["fmus", "build", "--kind", "fortran"]],
)  # fmt: skip
def test_bad_usage(command: Command, arguments: list[str]) -> None:
    done = command(*arguments)
    assert done.code == 2 and done.out == "" and done.err != ""


BAD_INPUT = """
system = "one.toml"
duration = 0.1
step = 1e-2
description = "x"
[inputs]
"gearbox.tau_a" = {source}
"""


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("nan", "inputs gearbox.tau_a must be a value, a list of values or a table, not nan"),
        ("{ times = [0.0, 0.1], values = [1.0, nan] }", "values, entry 2, must be a number,"),
        ('{ constant = 1.0, unit = "A" }', "unit 'A' (SI A) does not convert into 'N.m'"),
    ],
)  # fmt: skip
def test_bad_inputs_of_a_scenario(
    command: Command, tmp_path: Path, source: str, message: str
) -> None:
    (tmp_path / "one.toml").write_text('[instances]\ngearbox = "gearbox/ratio"\n')
    (tmp_path / "case.toml").write_text(BAD_INPUT.replace("{source}", source))
    done = command("run", "case.toml", "--out", "results")
    assert done.code == 2 and message in done.err and done.out == ""
    assert not (tmp_path / "results").exists()


def test_a_failed_check_fails_the_run(command: Command, tmp_path: Path) -> None:
    (tmp_path / "one.toml").write_text('[instances]\ngearbox = "gearbox/ratio"\n')
    check = '[[checks]]\nname = "torque"\nsignal = "gearbox.tau_b"\nof = "final"\nlimit = 1.0\n'
    (tmp_path / "case.toml").write_text(BAD_INPUT.replace("{source}", "1.0") + check)
    done = command("run", "case.toml", "--json")
    assert done.code == 1 and "1 of 1 checks failed: torque" in done.err
    assert json.loads(done.out)["checks"][0]["ok"] is False


def test_a_run_that_fails_keeps_what_it_had(command: Command, affine: Path, tmp_path: Path) -> None:
    (tmp_path / "one.toml").write_text(
        f'[instances]\nbelt = "{affine.as_posix()}"\n[parameters]\n"belt.fail_at" = 0.055\n'
    )
    case = BAD_INPUT.replace('"gearbox.tau_a" = {source}', "")
    (tmp_path / "case.toml").write_text(case)
    done = command("run", "case.toml", "--out", "results", "--json")
    assert done.code == 1 and done.out == ""
    assert "run stopped at t = 0.05 s: belt (affine)" in done.err and "belt came off" in done.err
    assert [path.name for path in (tmp_path / "results").iterdir()] == ["recording.parquet"]


def test_messages_of_the_progress_bar_stay_off_stdout(command: Command) -> None:
    with zipfile.ZipFile(fmu("gearbox/ratio")) as archive:
        assert "modelDescription.xml" in archive.namelist()
    done = command("run", "motor_bench/ST1", "--step", "1e-3", "--duration", "0.1", "--json")
    json.loads(done.out)  # one JSON value and nothing else


@pytest.mark.slow
def test_an_exported_scenario_runs_from_its_archive(command: Command, tmp_path: Path) -> None:
    archive, drawing = tmp_path / "bench.ssp", tmp_path / "bench.svg"
    assert command("export", "motor_bench/ST1", "--ssp", archive).code == 0
    assert command("draw", "motor_bench/ST1", "--out", drawing).code == 0
    assert "<svg" in drawing.read_text(encoding="utf-8")
    results = [
        json.loads(command("run", name, "--duration", "0.7", "--json").out)
        for name in (archive, "motor_bench/ST1")
    ]
    # the same FMUs, inputs and steps: the same energy to the last digit
    assert results[0]["energy_residual_J"] == results[1]["energy_residual_J"] != 0.0
    refused = command("export", "motor_bench", "--ssp", archive)
    assert refused.code == 2 and "name one" in refused.err
