"""Scenario files: schema, runs, data, checks, variants in short form."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cosim.errors import (
    InputError,
    ScenarioError,
    UnknownNameError,
    ValueRangeError,
    VariantError,
)
from cosim.running.runner import run
from cosim.scenario import scenario
from cosim.scenario.checks import circle_radius
from cosim.system.variants import apply, change

SYSTEM = """
connections = ["gearbox.tau_b -> load.tau", "gearbox.J_b -> load.J_added", "load.w -> gearbox.w_b"]
[instances]
gearbox = "gearbox.lab_bench/ratio"
load = "inertia.lab_bench/disc"
"""
SCENARIO = """
description = "torque on a disc"
system = "disc"
duration = 0.1
step = 1e-3
[parameters]
load.b = 0.0
[inputs]
"gearbox.tau_a" = { file = "torque.csv", column = "tau" }
[record]
signals = ["load.phi"]
period = 2e-3
[compare.w]
signal = "load.w"
times = [0.0, 0.1]
values = [0.0, 60.0]
unit = "rpm"
[[checks]]
name = "final speed"
signal = "load.w"
of = "final"
expected = 4.0
limit = 10.0
source = "none"
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "systems").mkdir()
    (tmp_path / "systems" / "disc.toml").write_text(SYSTEM)
    (tmp_path / "disc").mkdir()
    (tmp_path / "disc" / "scenario.toml").write_text(SCENARIO)
    (tmp_path / "disc" / "torque.csv").write_text("time,tau [mN.m]\n0,100\n0.05,0\n0.1,0\n")
    return tmp_path


def edit(folder: Path, old: str, new: str) -> None:
    path = folder / "disc" / "scenario.toml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def test_run_and_files(folder: Path, provider, tmp_path: Path) -> None:
    result = run("disc", provider=provider, folder=folder, out=tmp_path / "out")
    names = {path.name for path in result.files}
    assert names == {"recording.parquet", "recording.csv", "plot.png", "result.json"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == names
    content = json.loads((tmp_path / "out" / "result.json").read_text())
    assert list(content) == [
        "scenario", "variants", "algorithm", "step", "simulated_s", "wall_s", "fmu_steps",
        "energy_residual_J", "comparison", "checks", "notes", "files",
    ]  # fmt: skip
    assert set(content["comparison"]["w"]) == {"unit", "rms", "max", "reference"}
    assert content["comparison"]["w"]["unit"] == "rad/s"
    assert content["fmu_steps"] == 200 and content["variants"]["load"] == "inertia.lab_bench/disc"
    (check,) = content["checks"]
    assert {"name", "value", "limit", "ok", "source"} <= set(check)
    assert check["value"] == pytest.approx(abs(check["measured"] - 4.0))


def test_physics_of_the_run(folder: Path, provider) -> None:
    recording = run("disc", provider=provider, folder=folder).recording
    # 0.1 N.m over 0.05 s through 10.167 x 0.82 on 0.08 + 10.167^2 1.6e-4 kg.m2. The disc sees the
    # torque from the start (initial exchange), but its end one step late (Jacobi): 51 steps
    momentum = 0.1 * 10.167 * 0.82 * 0.051
    assert recording["load.w"][-1] == pytest.approx(
        momentum / (0.08 + 10.167**2 * 1.6e-4), rel=1e-9
    )  # solver of the disc is exact for constant torque up to rounding
    np.testing.assert_allclose(np.diff(recording.time), 2e-3, rtol=1e-9)


def test_runs_merge_into_the_scenario(folder: Path, provider) -> None:
    with (folder / "disc" / "scenario.toml").open("a") as handle:
        handle.write("[runs.short]\nduration = 0.05\n[runs.heavy]\nparameters.load.J = 1.0\n")
    file, _ = scenario.find("disc", folder)
    assert list(file.runs) == ["short", "heavy"]
    assert file.scenario("short").duration == 0.05
    assert file.scenario("heavy").parameters == {"load.b": 0.0, "load.J": 1.0}
    both = run("disc", provider=provider, folder=folder)
    assert list(both.runs) == ["short", "heavy"]
    assert set(both.to_dict()["comparison"]) == {"short: w", "heavy: w"}
    one = run("disc/heavy", provider=provider, folder=folder)
    assert one.name == "disc/heavy" and set(one.to_dict()["comparison"]) == {"w"}
    with pytest.raises(UnknownNameError, match=r"short, heavy as run, not 'light'"):
        run("disc/light", provider=provider, folder=folder)


def test_one_run_per_row_of_a_table(folder: Path) -> None:
    (folder / "disc" / "rows.csv").write_text("set,torque\n1,0.5\n2,0.7\n")
    edit(folder, 'file = "torque.csv", column = "tau"', 'constant = "{torque}", unit = "N.m"')
    edit(folder, 'description = "', '[table]\nfile = "rows.csv"\nname = "SET{set}"\n#"')
    text = (folder / "disc" / "scenario.toml").read_text()
    head, _, rest = text.partition("system =")
    (folder / "disc" / "scenario.toml").write_text("system =" + rest + head)
    file, _ = scenario.find("disc", folder)
    assert list(file.runs) == ["SET1", "SET2"]
    signal = file.scenario("SET2").inputs["gearbox.tau_a"]
    assert signal.at(np.zeros(1))[0] == 0.7 and signal.unit == "N.m"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("duration = 0.1", 'duration = "long"', "duration must be a number, not 'long'"),
        ("duration =", "durration =", "a scenario has no key 'durration'; did you mean 'duration'"),
        ('system = "disc"', 'system = "disk"', "there is no system 'disk'"),
        ('system = "disc"', f'system = "{"d" * 300}"', "there is no system 'ddd"),
        ('column = "tau"', 'column = "tua"', "torque.csv: has no column 'tua'; did you mean 'tau'"),
        ('"torque.csv"', '"lost.csv"', "lost.csv: there is no such file"),
        ("[inputs]", "[inputs", "is not TOML"),
        ('of = "final"', 'of = "last"', "of = 'last' is not one of initial, final"),
        ("limit = 10.0", "", "name and limit are needed"),
        ('signal = "load.w"\ntimes', "times", "compare w: signal is missing"),
        ("period = 2e-3", "period = 1.5e-3", "record period 0.0015 s is not a whole number"),
    ],
)
def test_bad_scenarios(folder: Path, provider, old: str, new: str, message: str) -> None:
    edit(folder, old, new)
    with pytest.raises(InputError, match=message):
        run("disc", provider=provider, folder=folder)


def test_gap_in_an_input(folder: Path, provider, tmp_path: Path) -> None:
    (folder / "disc" / "torque.csv").write_text("time,tau\n0,1\n0.05,\n0.1,0\n")
    with pytest.raises(
        InputError, match=r"torque.csv:tau: 1 of 3 values are not finite.* t = 0.05 s"
    ):
        run("disc", provider=provider, folder=folder, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_unknown_scenario(folder: Path, provider) -> None:
    with pytest.raises(UnknownNameError, match=r"there is no scenario 'disk'; did you mean 'disc'"):
        run("disk", provider=provider, folder=folder)


def test_parameter_and_variant_changes(folder: Path, provider) -> None:
    result = run(
        "disc", provider=provider, folder=folder,
        variants={"gearbox": "lossy"}, parameters={"load.J": 0.5},
    )  # fmt: skip
    assert result.to_dict()["variants"]["gearbox"] == "gearbox.lab_bench/lossy"
    assert result.recording.provenance["instances"]["load"]["parameters"] == {"b": 0.0, "J": 0.5}
    with pytest.raises(InputError, match=r"load: J = -1 kg.m2 is outside its bounds"):
        run("disc", provider=provider, folder=folder, parameters={"load.J": -1.0})
    with pytest.raises(UnknownNameError, match=r"no variable 'JJ'"):
        run("disc", provider=provider, folder=folder, parameters={"load.JJ": 1.0})


# -- short forms of variants -----------------------------------------------------------------------

HERE = {
    "left": "gearbox.mir250/ratio",
    "right": "gearbox.mir250/elastic+coulomb",
    "base": "mobile_base/six_dof[wheel_contact=smooth]+payload@body",
    "other": "foreign.fmu",
}


def test_change() -> None:
    assert change("gearbox.mir250/ratio", "elastic+backlash") == "gearbox.mir250/elastic+backlash"
    assert (
        change("gearbox/ratio+coulomb", "+backlash@flange_b")
        == "gearbox/ratio+coulomb+backlash@flange_b"
    )
    assert change("gearbox/ratio", "gearbox.ur5/lossy") == "gearbox.ur5/lossy"
    assert change("gearbox/ratio", "my.fmu") == "my.fmu"
    with pytest.raises(VariantError, match=r"cannot change 'foreign.fmu', which is a file"):
        change("foreign.fmu", "elastic")


def test_apply_to_instance_component_or_slot() -> None:
    assert apply(HERE, {"left": "lossy"})["left"] == "gearbox.mir250/lossy"
    both = apply(HERE, {"gearbox": "+backlash"})
    assert both["left"] == "gearbox.mir250/ratio+backlash"
    assert both["right"] == "gearbox.mir250/elastic+coulomb+backlash"
    slot = apply({"base": HERE["base"]}, {"wheel_contact": "brush"})
    assert slot == {"base": "mobile_base/six_dof[wheel_contact=brush]+payload@body"}
    two = apply({"base": "mobile_base/six_dof[wheel_contact=brush,x=y]"}, {"wheel_contact": "a"})
    assert two == {"base": "mobile_base/six_dof[wheel_contact=a,x=y]"}
    with pytest.raises(UnknownNameError, match=r"'wheel' is no instance, component or slot"):
        apply({"base": "x.fmu"}, {"wheel": "brush"})


def test_circle_radius() -> None:
    angle = np.linspace(0.0, 1.5, 20)
    x, y = 3.0 + 0.25 * np.cos(angle), -1.0 + 0.25 * np.sin(angle)
    assert circle_radius(x, y) == pytest.approx(0.25, rel=1e-9)  # conditioning of a quarter circle


def test_library_scenarios_can_be_read() -> None:
    files = scenario.scenario_files()
    assert files
    for file in files:
        assert file.text
        for name in file.runs:
            item = file.scenario(name)
            assert item.duration > 0.0


def test_scenario_error_is_wrong_input() -> None:
    assert ScenarioError.exit_code == 2


def test_a_shorter_run_keeps_only_the_checks_that_it_reaches(folder: Path, provider) -> None:
    with (folder / "disc" / "scenario.toml").open("a") as handle:
        handle.write(
            '[[checks]]\nname = "early"\nsignal = "load.w"\nof = "peak"\nbefore = 0.02\nlimit = 9\n'
        )
    assert set(run("disc", provider=provider, folder=folder).checks) == {"final speed", "early"}
    short = run("disc", provider=provider, folder=folder, duration=0.05)
    assert set(short.checks) == {"early"}


def test_another_step_and_record_period(folder: Path, provider) -> None:
    again = run("disc", provider=provider, folder=folder, step=5e-3, record_period=0.01)
    np.testing.assert_allclose(again.recording.time, np.linspace(0.0, 0.1, 11), atol=1e-12)
    with pytest.raises(
        ValueRangeError, match=r"0\.002 s is not a whole .* of 0\.0015 s; record every 0\.0015 s"
    ):
        run("disc", provider=provider, folder=folder, step=1.5e-3)
    for period in (1e-3, -1.0):
        with pytest.raises(ValueRangeError, match=r"shorter than a step of 0\.005 s; record every"):
            run("disc", provider=provider, folder=folder, step=5e-3, record_period=period)


def _with_checks(folder: Path, *holds: str) -> None:
    path = folder / "disc" / "scenario.toml"
    path.write_text(
        path.read_text()
        + "".join(
            f'[[checks]]\nname = "{i}"\nsignal = "load.w"\nof = "peak"\nlimit = -1\n{line}\n'
            for i, line in enumerate(holds)
        )
    )


def test_checks_of_declared_variants_do_not_judge_others(folder: Path, provider) -> None:
    _with_checks(
        folder, "", "holds_for = {}", 'holds_for = { load = "pendulum" }',
        'holds_for = { load = ["disc", "pendulum"] }', 'holds_for = { load = "disc" }',
    )  # fmt: skip

    def failed(**changes) -> set[str]:
        found = run("disc", provider=provider, folder=folder, **changes).checks
        assert {name for name, check in found.items() if check.to_dict()["ok"] is None} == {
            name for name, check in found.items() if check.unfit
        }
        return {name for name, check in found.items() if check.failed}

    assert failed() == {"0", "1", "3", "4"}
    assert failed(parameters={"load.J": 0.2}) == {"0", "1", "3", "4"}  # values change no variant
    assert failed(variants={"load": "pendulum"}) == {"1", "2", "3"}
    assert failed(variants={"load": "disc"}) == {"0", "1", "3", "4"}  # the declared one again


def test_why_a_check_is_not_judged(folder: Path, provider) -> None:
    _with_checks(folder, "")
    result = run("disc", provider=provider, folder=folder, variants={"load": "+coulomb@flange"})
    why = "load is inertia.lab_bench/disc+coulomb@flange, it holds for inertia.lab_bench/disc"
    assert [check.to_dict()["not_judged"] for check in result.checks.values()] == [why, why]


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ('holds_for = { lod = "disc" }', "check '0': holds_for names no instance 'lod'; did you"),
        ('holds_for = "disc"', "holds_for must be a table"),
        ("holds_for = { load = 1 }", "holds_for load must be a variant or a list of variants"),
    ],
)
def test_wrong_holds_for(folder: Path, provider, line, text) -> None:
    _with_checks(folder, line)
    with pytest.raises(ScenarioError, match=text):
        run("disc", provider=provider, folder=folder)


def test_what_a_changed_variant_does_not_have_is_left_out_and_noted(folder: Path, provider) -> None:
    path = folder / "systems" / "disc.toml"
    path.write_text(path.read_text().replace("inertia.lab_bench/disc", "inertia/pendulum"))
    edit(folder, "load.b = 0.0", "load.b = 0.0\nload.m = 0.5")
    edit(folder, '"load.phi"]', '"load.phi", "load.m"]')
    whole = run("disc", provider=provider, folder=folder).runs[""]
    assert whole.notes == () and "load.m" in whole.recording.names
    item = run("disc", provider=provider, folder=folder, variants={"load": "disc"}).runs[""]
    assert item.notes == (
        "load.m of the scenario is left out: inertia/disc has none",
        "load.m is not recorded: inertia/disc has none",
    )
    with pytest.raises(UnknownNameError, match=r"inertia/disc has no variable 'm'"):
        run(
            "disc", provider=provider, folder=folder,
            variants={"load": "disc"}, parameters={"load.m": 1.0},
        )  # fmt: skip
