"""Logs become a data set that calibrates: the robot's values come back, and its camera's clock."""

from __future__ import annotations

import json
import os
import pty
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from cosim.calibrate import read_problem
from cosim.calibrate.clocks import offsets
from cosim.calibrate.fit import fit
from cosim.calibrate.simulator import Simulator
from cosim.cli.app import app
from cosim.errors import CosimError, InputError, UnknownNameError
from cosim.files import read_toml
from cosim.installation.builder import default_provider
from cosim.intake.example import RADIUS, SYSTEM, TRACK, drive, write_csv
from cosim.intake.given import late_of
from cosim.intake.grouping import grouped
from cosim.intake.importing import Imported, Inspected, Wishes, import_logs
from cosim.intake.matching import Column, Match, Place
from cosim.intake.runs import purposes

LATE = 0.23
"""[s] No multiple of the camera's or the commands' interval."""


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("logs")
    for seed, name in enumerate(("one", "two", "three")):
        write_csv(drive(seed, late=LATE), name, folder)
    (folder / "robot.toml").write_text(SYSTEM)
    return folder


def imported(
    logs: Path, out: Path, *maps: str, pattern: str = "*_*.csv", **more: object
) -> Imported:
    ask = more.pop("ask", None)
    wishes = Wishes(str(logs / "robot.toml"), maps, **more)  # type: ignore[arg-type]
    files = grouped(sorted(logs.glob(pattern)), {}, Inspected(wishes).columns).runs
    chosen = purposes(list(files), [])
    return import_logs(files, chosen, wishes, out, default_provider(), ask)  # type: ignore[arg-type]


def test_two_files_a_run_with_a_late_camera(logs: Path, tmp_path: Path) -> None:
    done = imported(logs, tmp_path / "set")
    assert [f for f in done.findings if f.severity == "error"] == []
    assert sorted(done.parameters) == ["base.r", "base.track"]
    assert {n: m.column.source for n, m in done.matches.inputs.items()} == {
        "base.w_l": "cmd.left_rpm", "base.w_r": "cmd.right_rpm",
    }  # fmt: skip
    text = " ".join((tmp_path / "set" / "dataset.toml").read_text().replace("\n#", "").split())
    assert "How late the clock of pose is against that of cmd" in text
    assert "In rpm: its name ends with it." in text and "begins anew at a turn" in text
    problem = read_problem(tmp_path / "set")
    assert problem.sigma == pytest.approx((0.002, 0.002, 0.004), rel=0.25)  # 300 samples, order 8
    estimate = fit(Simulator(problem))
    values = dict(zip(problem.names, estimate.theta, strict=True))
    width = dict(zip(problem.names, estimate.high - estimate.low, strict=True))
    for name, truth in (("base.r", RADIUS), ("base.track", TRACK)):
        assert abs(values[name] - truth) < width[name]  # four deviations
        assert width[name] < 0.02 * truth
    (clock,) = offsets(estimate).values()
    assert abs(clock["value"] - LATE) < clock["ci95"][1] - clock["ci95"][0] < 0.02
    residuals = np.concatenate([r for _, r in estimate.residuals])
    assert np.sqrt(np.nanmean(residuals**2)) == pytest.approx(1.0, abs=0.2)  # sigma is estimated


def test_one_clock_needs_no_late_one(tmp_path: Path) -> None:
    run = drive(5)
    lines = ["t,left_set_rpm,right_set_rpm,x_m,y_m,yaw_rad"]
    for i, row in enumerate(run.pose):
        lines.append(",".join(f"{v:.6f}" for v in (
            run.stamped[i], run.left[2 * i] * 30 / np.pi, run.right[2 * i] * 30 / np.pi, *row,
        )))  # fmt: skip
    (tmp_path / "a.csv").write_text("\n".join(lines))
    (tmp_path / "robot.toml").write_text(SYSTEM)
    done = imported(tmp_path, tmp_path / "set", pattern="a.csv")
    table = read_toml(tmp_path / "set" / "dataset.toml")
    assert not any("clock:" in str(entry["targets"]) for entry in table["nuisance"])
    assert len(table["nuisance"]) == 3  # where the run begins
    assert table["run"] == [{"name": "a", "file": "logs/a.csv", "purpose": "identification"}]
    assert done.runs[0].purpose == "identification"


@pytest.mark.parametrize("kind", ["parquet", "csv"])
def test_clocks_in_units_that_a_mapping_cannot_know_are_converted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    """Small milliseconds beside seconds: both files become tables with nanoseconds."""
    monkeypatch.setattr("cosim.intake.files.has", lambda module: kind == "parquet")
    commands, poses = write_csv(drive(0), "a", tmp_path)
    for path, divisor in ((commands, 1e6), (poses, 1e9)):
        head, *rows = path.read_text().splitlines()
        unit = {1e6: "ms", 1e9: "s"}[divisor]
        lines = [head.replace("stamp_ns", f"t_{unit}")]
        for row in rows:
            stamp, _, rest = row.partition(",")
            lines.append(f"{(int(stamp) - 1_764_040_000 * 10**9) / divisor:.9g},{rest}")
        path.write_text("\n".join(lines))
    (tmp_path / "robot.toml").write_text(SYSTEM)
    imported(tmp_path, tmp_path / "set")
    assert sorted(p.name for p in (tmp_path / "set" / "logs").iterdir()) == [
        f"a_cmd.{kind}", f"a_pose.{kind}",
    ]  # fmt: skip
    problem = read_problem(tmp_path / "set")
    run = problem.runs[0]
    assert np.diff(run.times) == pytest.approx(0.04, abs=1e-9)  # whole nanoseconds
    assert np.diff(run.inputs["base.w_l"].times)[:-1] == pytest.approx(0.02, abs=1e-9)  # type: ignore[attr-defined]


@pytest.mark.parametrize("begin", [5 * 10**12, 2 * 10**12])
def test_nanoseconds_since_boot_are_told_to_the_mapping(tmp_path: Path, begin: int) -> None:
    """2e12 is a time since 1970 in ms, and the mapping knows sizes only."""
    run = drive(0)
    rows = np.column_stack([np.rint(run.stamped * 1e9) + begin, run.pose,
                            np.interp(run.stamped, run.commanded, run.left),
                            np.interp(run.stamped, run.commanded, run.right)])  # fmt: skip
    np.savetxt(tmp_path / "a_log.csv", rows, delimiter=",", comments="", fmt="%.17g",
               header="stamp_ns,x,y,heading_rad,left_rpm,right_rpm")  # fmt: skip
    (tmp_path / "robot.toml").write_text(SYSTEM)
    imported(tmp_path, tmp_path / "set")
    times = read_problem(tmp_path / "set").runs[0].times
    # nanoseconds are whole
    assert np.diff(times) == pytest.approx(np.diff(run.stamped), abs=2e-9)


def test_a_merged_table_with_two_clocks_is_taken_apart(tmp_path: Path) -> None:
    run = drive(1, late=0.1)
    lines = ["c_t,c_left_rpm,c_right_rpm,p_t,p_x_m,p_y_m,p_yaw_rad"]
    for i, time in enumerate(run.commanded):
        row = [f"{v:.6f}" for v in (time, run.left[i] * 30 / np.pi, run.right[i] * 30 / np.pi)]
        pose = [run.stamped[i // 2], *run.pose[i // 2]] if i % 2 == 0 else None
        lines.append(",".join(row + ([f"{v:.6f}" for v in pose] if pose else [""] * 4)))
    (tmp_path / "a.csv").write_text("\n".join(lines))
    (tmp_path / "robot.toml").write_text(SYSTEM)
    done = imported(tmp_path, tmp_path / "set", pattern="a.csv")
    assert done.matches.inputs["base.w_l"].column.source == "c.c_left_rpm"
    assert done.matches.channels["base.phi"].column.source == "p.p_yaw_rad"
    assert "clock:p_x" in (tmp_path / "set" / "dataset.toml").read_text()


def test_what_is_missing_is_listed_with_its_flag_and_nothing_is_written(
    logs: Path, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as caught:
        imported(logs, tmp_path / "set", pattern="*_pose.csv")
    text = str(caught.value)
    assert "--map 'COLUMN=base.w_l'" in text and "--map '0=base.w_r'" in text
    assert "columns that fit by their unit: none" in text
    with pytest.raises(InputError, match="no column is matched to an output"):
        imported(logs, tmp_path / "set", pattern="*_cmd.csv")
    with pytest.raises(
        UnknownNameError, match=r"no column 'cmd.lft_rpm'; did you mean 'cmd.left_rpm'"
    ):
        imported(logs, tmp_path / "set", "cmd.lft_rpm=base.w_l")
    assert not (tmp_path / "set").exists()


def test_a_unit_that_nothing_tells_is_asked_for(logs: Path, tmp_path: Path) -> None:
    for path in logs.glob("one_*.csv"):
        text = path.read_text().replace("left_rpm", "left").replace("right_rpm", "right")
        (tmp_path / path.name).write_text(text)
    (tmp_path / "robot.toml").write_text(SYSTEM)
    maps = ["left=base.w_l", "right=base.w_r"]
    with pytest.raises(InputError, match=r"--map 'cmd.left=base.w_l:UNIT'"):
        imported(tmp_path, tmp_path / "set", *maps)
    done = imported(tmp_path, tmp_path / "set", *[f"{m}:rpm" for m in maps])
    assert done.matches.inputs["base.w_l"].column.unit.unit == "rpm"


class Answers:
    """Somebody who knows."""

    def __init__(self) -> None:
        self.asked: list[str] = []

    def column(self, place: Place, columns: Sequence[Column]) -> str:
        self.asked.append(place.name)
        return columns[0].source

    def variable(self, source: str, names: Sequence[str]) -> str:
        self.asked.append(source)
        return names[0] if source == "pose.yaw_deg" else ""

    def unit(self, match: Match) -> str:
        self.asked.append(match.column.source)
        return "rpm"


def test_somebody_is_asked_what_is_open_only(logs: Path, tmp_path: Path) -> None:
    commands, poses = (tmp_path / f"one_{end}.csv" for end in ("cmd", "pose"))
    text = (logs / "one_cmd.csv").read_text()
    commands.write_text(text.replace("left_rpm", "wheel_1").replace("right_rpm", "right"))
    head, *rows = (logs / "one_pose.csv").read_text().splitlines()
    rows = [f"{row},{row.rpartition(',')[2]}" for row in rows]
    poses.write_text("\n".join([f"{head},yaw_deg", *rows]))
    (tmp_path / "robot.toml").write_text(SYSTEM)
    answers = Answers()
    done = imported(tmp_path, tmp_path / "set", ask=answers)
    assert answers.asked == [
        "base.w_l", "pose.heading_deg", "pose.yaw_deg", "cmd.wheel_1", "cmd.right",
    ]  # fmt: skip
    assert done.matches.channels["base.phi"].column.source == "pose.yaw_deg"
    assert done.matches.inputs["base.w_l"].column.unit.unit == "rpm"


def test_a_column_that_never_changes_is_no_measurement(logs: Path, tmp_path: Path) -> None:
    for end in ("cmd", "pose"):
        lines = (logs / f"one_{end}.csv").read_text().splitlines()
        lines = [f"{line},{'still' if k == 0 else 1.25}" for k, line in enumerate(lines)]
        (tmp_path / f"one_{end}.csv").write_text("\n".join(lines))
    (tmp_path / "robot.toml").write_text(SYSTEM)
    with pytest.raises(InputError, match=r"--map pose\.still=base\.phi:rad: the column never ch"):
        imported(tmp_path, tmp_path / "set", "pose.still=base.phi:rad")
    assert not (tmp_path / "set").exists()


def test_a_run_that_is_shorter_than_the_window_is_named(logs: Path, tmp_path: Path) -> None:
    for name, rows in (("long_cmd", 601), ("long_pose", 301), ("short_cmd", 300)):
        lines = (logs / f"one_{name.partition('_')[2]}.csv").read_text().splitlines()
        (tmp_path / f"{name}.csv").write_text("\n".join(lines[:rows]))
    lines = (logs / "one_pose.csv").read_text().splitlines()
    (tmp_path / "short_pose.csv").write_text("\n".join(lines[:151]))
    (tmp_path / "robot.toml").write_text(SYSTEM)
    with pytest.raises(
        InputError, match=r"--window 10: these runs last less: short 5\.96 s; leave"
    ):
        imported(tmp_path, tmp_path / "set", window=10.0)
    assert not (tmp_path / "set").exists()


def test_runs_are_cut_into_windows_with_starts_of_their_own(logs: Path, tmp_path: Path) -> None:
    done = imported(logs, tmp_path / "set", window=4.0, parameters={"base.r": ()})
    assert len(done.runs) == 3
    problem = read_problem(tmp_path / "set")
    assert [run.name for run in problem.runs][:3] == ["one 0", "one 1", "three 0"]
    starts = [p.name for p in problem.parameters if p.name.startswith("start of px")]
    assert starts == [f"start of px@{run.name}" for run in problem.runs]
    # a clock is late by a tenth of a window at most
    clock = next(p for p in problem.parameters if p.name == "clock of pose")
    assert (clock.minimum, clock.maximum) == pytest.approx((-0.4, 0.4), rel=1e-9)


def test_logs_of_one_name_do_not_overwrite_each_other(logs: Path, tmp_path: Path) -> None:
    files = {}
    for run in ("one", "two"):
        (tmp_path / run).mkdir()
        for end in ("cmd", "pose"):
            content = (logs / f"{run}_{end}.csv").read_bytes()
            (tmp_path / run / f"{end}.csv").write_bytes(content)
        files[run] = [tmp_path / run / "cmd.csv", tmp_path / run / "pose.csv"]
    chosen = dict.fromkeys(files, "identification")
    wishes = Wishes(str(logs / "robot.toml"), (), {"base.r": ()})
    import_logs(files, chosen, wishes, tmp_path / "set", default_provider())
    one, two = read_problem(tmp_path / "set").runs
    assert one.data.shape != two.data.shape or np.nanmax(np.abs(one.data - two.data)) > 0.1


def test_a_folder_that_has_a_mapping_is_not_overwritten(logs: Path, tmp_path: Path) -> None:
    (tmp_path / "dataset.toml").write_text("")
    with pytest.raises(InputError, match="is there already; choose another folder with --out"):
        imported(logs, tmp_path)


def test_runs_must_have_the_same_parts(logs: Path, tmp_path: Path) -> None:
    files = {"a": [logs / "one_cmd.csv", logs / "one_pose.csv"], "b": [logs / "two_pose.csv"]}
    chosen = {"a": "identification", "b": "validation"}
    with pytest.raises(InputError, match="run b has the parts one table, but run a has"):
        import_logs(files, chosen, Wishes(str(logs / "robot.toml")), tmp_path, default_provider())


def test_a_clock_that_is_known_to_be_late_is_not_estimated(logs: Path, tmp_path: Path) -> None:
    """What is left over is then a delay of the commands; held columns move, samples stay."""
    imported(logs, tmp_path / "set", late={"pose": LATE}, parameters={"base.r": ()})
    content = read_toml(tmp_path / "set" / "dataset.toml")
    assert content["columns"]["left"]["late"] == -LATE and "late" not in content["columns"]["px"]
    assert "clock of pose" not in [n["name"] for n in content.get("nuisance", ())]
    imported(logs, tmp_path / "plain", parameters={"base.r": ()})
    first = [
        [run.get("samples", [1])[0] for run in read_toml(tmp_path / name / "dataset.toml")["run"]]
        for name in ("set", "plain")
    ]
    pairs = zip(
        read_problem(tmp_path / "set").runs, read_problem(tmp_path / "plain").runs, *first,
        strict=True,
    )  # fmt: skip
    for run, other, begins, plain in pairs:
        times = run.times[(run.times > 1.0) & (run.times < 8.0)]
        earlier = times + (begins - plain) * 0.04 - LATE  # 25 Hz
        for name in ("base.w_l", "base.w_r"):
            moved, still = (r.inputs[name].at(t) for r, t in ((run, times), (other, earlier)))
            assert np.mean(moved == still) > 0.98  # not where a value changes at that instant
    with pytest.raises(UnknownNameError, match=r"--late pos: no part .* did you mean 'pose'"):
        imported(logs, tmp_path / "other", late={"pos": LATE})


def test_how_late_is_a_number() -> None:
    assert late_of(["pose=0.3", "imu=-0.01"]) == {"pose": 0.3, "imu": -0.01}
    for wrong in ("pose", "pose=x", "=1", "pose=nan"):
        with pytest.raises(InputError, match=f"--late {wrong}: write --late PART=SECONDS"):
            late_of([wrong])


def test_what_the_logs_do_not_tell_apart_is_said(tmp_path: Path) -> None:
    """Efficiency over inertia shows, and over friction: one of the three keeps its value."""
    (tmp_path / "drive.toml").write_text(
        'connections = ["gear.tau_b -> load.tau", "load.w -> gear.w_b"]\n'
        '[instances]\ngear = "gearbox/ratio"\nload = "inertia/disc"\n'
        "[parameters]\ngear.J_a = 0.0\ngear.ratio = 10.0\ngear.eta = 0.8\n"
        "load.J = 0.1\nload.b = 0.05\n"
    )
    chance, w, lines = np.random.default_rng(1), 0.0, ["t_s,torque_Nm,speed_rad_s"]
    for k in range(400):
        torque = 0.1 if k // 80 % 2 else -0.05
        lines.append(f"{0.02 * k:.2f},{torque},{w + chance.normal(0.0, 0.01):.5f}")
        w += 0.02 * (8.0 * torque - 0.05 * w) / 0.1
    (tmp_path / "a.csv").write_text("\n".join(lines))
    wishes = Wishes(str(tmp_path / "drive.toml"), ["torque_Nm=gear.tau_a", "speed_rad_s=load.w"])
    kept = "the logs do not tell gear.eta apart from the rest"

    def notes(given: dict[str, tuple[float, ...]]) -> str:
        asked = replace(wishes, parameters=given)
        out = tmp_path / f"set_{len(given)}"
        purpose = {"a": "identification"}
        done = import_logs({"a": [tmp_path / "a.csv"]}, purpose, asked, out, default_provider())
        return " ".join(done.notes)

    assert kept in notes({})
    assert kept not in notes({"load.b": ()})  # who says what is estimated knows


# -- the command -----------------------------------------------------------------------------------


def test_the_command_says_what_it_did(logs: Path, tmp_path: Path) -> None:
    args = ["data", "import", *map(str, sorted(logs.glob("*_*.csv"))), "--system",
            str(logs / "robot.toml"), "--out", str(tmp_path / "set"), "--json",
            "--parameter", "base.r=0.05:0.04:0.06", "--validation", "one"]  # fmt: skip
    done = CliRunner().invoke(app, args, catch_exceptions=False)
    content = json.loads(done.stdout)
    assert content["runs"] == {"one": "validation", "three": "identification",
                               "two": "identification"}  # fmt: skip
    assert content["parameters"] == ["base.r"]
    assert content["channels"]["base.phi"]["column"] == "pose.heading_deg"
    (parameter,) = read_toml(tmp_path / "set" / "dataset.toml")["parameter"]
    assert (parameter["min"], parameter["nominal"], parameter["max"]) == (0.04, 0.05, 0.06)


def test_systems_are_found_by_near_names() -> None:
    for given, said in (
        ([], "--system is missing"),
        (["--system", "motor_bensh"], "'motor_bench'"),
    ):
        done = CliRunner().invoke(app, ["data", "import", "a.csv", *given])
        assert isinstance(done.exception, CosimError) and said in str(done.exception)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="terminals are those of POSIX")
def test_somebody_at_a_terminal_is_asked(tmp_path: Path) -> None:
    commands, poses = write_csv(drive(3), "a", tmp_path)
    text = commands.read_text().replace("left_rpm", "one_rpm").replace("right_rpm", "other_rpm")
    commands.write_text(text)
    (tmp_path / "robot.toml").write_text(SYSTEM)
    here, there = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "cosim", "data", "import", "--run", f"a={commands},{poses}",
         "--system", "robot.toml", "--out", "set", "--json"],
        cwd=tmp_path, stdin=there, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
    )  # fmt: skip
    os.write(here, b"9\n1\ncmd.other_rpm\n")
    out, err = process.communicate(timeout=100)
    os.close(here)
    os.close(there)
    assert process.returncode == 0, err
    assert "which column is it?" in err and "'9' is none of them" in err
    assert json.loads(out)["inputs"]["base.w_r"]["column"] == "cmd.other_rpm"
