"""Poses as cameras give them: quaternions, and zeros while the robot is lost."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate import read_problem
from cosim.files import read_toml
from cosim.installation.builder import default_provider
from cosim.intake.example import SYSTEM, drive
from cosim.intake.importing import Imported, Inspected, Wishes, import_logs
from cosim.intake.inspect import TopicReport, inspect

STEM = "field.pose.orientation."
PLACES = ["field.pose.position.x", "field.pose.position.y"]
LOST = slice(60, 75)
"""Rows of the camera."""


def write(folder: Path, name: str, seed: int, *, zeros: bool) -> None:
    """Commands and poses of a run, with the names that `rostopic echo -p` gives."""
    run = drive(seed)
    rows = np.column_stack([run.commanded, run.left, run.right])
    np.savetxt(folder / f"{name}_cmd.csv", rows, delimiter=",",
               header="t_s,left_rad_s,right_rad_s", comments="")  # fmt: skip
    x, y, yaw = run.pose.T
    still = np.zeros_like(x)
    pose = np.column_stack([x, y, still, still, np.sin(yaw / 2), np.cos(yaw / 2)])
    if zeros:
        pose[LOST] = 0.0
    heads = ["t_s", *PLACES, *(STEM + c for c in "xyzw")]
    np.savetxt(folder / f"{name}_pose.csv", np.column_stack([run.stamped, pose]), delimiter=",",
               header=",".join(heads), comments="")  # fmt: skip
    (folder / "robot.toml").write_text(SYSTEM)


def imported(folder: Path, *maps: str) -> Imported:
    files = {"a": [folder / "a_cmd.csv", folder / "a_pose.csv"]}
    wishes = Wishes(str(folder / "robot.toml"), maps, {"base.r": (), "base.track": ()})
    return import_logs(files, {"a": "identification"}, wishes, folder / "set", default_provider(),
                       inspected=Inspected(wishes))  # fmt: skip


def looked(folder: Path) -> TopicReport:
    (topic,) = inspect(folder / "a_pose.csv").topics
    return topic


def test_a_quaternion_is_one_thing_and_its_yaw_another(tmp_path: Path) -> None:
    """Its w was taken for a speed, by its name."""
    write(tmp_path, "a", 1, zeros=False)
    units = {c.name: c.unit for c in looked(tmp_path).columns}
    assert (units[STEM + "yaw"].unit, units[STEM + "yaw"].sure) == ("rad", True)
    for c in "xyzw":
        assert units[STEM + c].unit == "1"
        assert units[STEM + c].reason == f"of a quaternion, whose yaw is {STEM}yaw"


def test_a_mapping_makes_the_yaw_of_a_quaternion(tmp_path: Path) -> None:
    write(tmp_path, "a", 1, zeros=False)
    done = imported(tmp_path)
    assert {n: m.column.name for n, m in done.matches.channels.items()} == {
        "base.x": PLACES[0], "base.y": PLACES[1], "base.phi": STEM + "yaw",
    }  # fmt: skip
    (entry,) = [
        c for c in read_toml(tmp_path / "set" / "dataset.toml")["columns"].values()
        if "quaternion" in c
    ]  # fmt: skip
    assert entry["quaternion"] == [f"pose.{STEM}{c}" for c in "xyzw"]
    problem = read_problem(tmp_path / "set")
    (index,) = [k for k, c in enumerate(problem.channels) if c.signal == "base.phi"]
    (run,) = problem.runs
    values, yaw = run.data[:, index], drive(1).pose[: run.times.size, 2]
    known = np.isfinite(values)  # not within what the camera's clock may be late
    assert known.sum() > 200
    # it counts whole turns from the one in which the log begins
    assert np.ptp((values - yaw)[known]) < 1e-6


@pytest.mark.parametrize("broken", ["three of them", "another length"])
def test_what_is_no_quaternion_is_left_alone(tmp_path: Path, broken: str) -> None:
    write(tmp_path, "a", 1, zeros=False)
    text = (tmp_path / "a_pose.csv").read_text()
    if broken == "three of them":
        text = text.replace(STEM + "y", STEM + "b")
    else:
        head, *rows = text.splitlines()
        text = "\n".join([head, *(f"{r.rpartition(',')[0]},2.0" for r in rows)])
    (tmp_path / "a_pose.csv").write_text(text)
    assert STEM + "yaw" not in [c.name for c in looked(tmp_path).columns]


def test_zeros_of_a_camera_that_has_lost_the_robot(tmp_path: Path) -> None:
    """They are named, and the mapping makes gaps of them."""
    write(tmp_path, "a", 1, zeros=True)
    found = {f.column: f.text for f in looked(tmp_path).findings if "exactly 0" in f.text}
    assert set(PLACES) < set(found)
    assert "in 15 rows, from 2.4 s on, together with" in found[PLACES[0]]
    assert "missing = 0 in [columns] makes gaps of them" in found[PLACES[0]]
    assert any("rows that are exactly 0 together" in note for note in imported(tmp_path).notes)
    columns = read_toml(tmp_path / "set" / "dataset.toml")["columns"]
    assert [c.get("missing") for c in columns.values()] == [None, None, 0, 0, None]
    (run,) = read_problem(tmp_path / "set").runs
    gone = np.isnan(run.data).all(axis=1)
    assert np.count_nonzero(gone) >= LOST.stop - LOST.start
    assert np.nanmax(np.abs(np.diff(run.data, axis=0))) < 0.2  # nothing jumps to 0


def test_a_robot_that_stops_or_crosses_zero_is_not_lost(tmp_path: Path) -> None:
    """Speeds fall to 0 together, and rise again slowly; a place goes through 0; commands step."""
    times = np.arange(600) * 0.02
    speed = np.where((times > 4.0) & (times < 6.0), 0.0, 0.3 + 0.1 * np.sin(times))
    speed[times >= 6.0] *= np.minimum((times[times >= 6.0] - 6.0) / 1.0, 1.0)
    place = np.round(np.sin(times), 2)
    command = np.repeat([0.0, 1.0, 0.0, 2.0, 0.0, 1.0], 100)
    rows = np.column_stack([times, speed, 1.2 * speed, place, 1.1 * place, command, 2 * command])
    np.savetxt(tmp_path / "a_pose.csv", rows, delimiter=",", header="t_s,v,w,x,y,cmd_l,cmd_r",
               comments="")  # fmt: skip
    assert [f for f in looked(tmp_path).findings if "exactly 0" in f.text] == []
