"""Heads of columns: which line is the head, and what units it states."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from cosim.cli.app import app
from cosim.data.logs import read_log
from cosim.data.text import head
from cosim.errors import InputError, ScenarioError, UnknownNameError
from cosim.installation.builder import default_provider
from cosim.intake.example import SYSTEM
from cosim.intake.importing import Wishes, import_logs
from cosim.intake.inspect import inspect

ROWS = "".join(f"{0.1 * i:.1f};{i}\n" for i in range(20))


def log(folder: Path, text: str) -> Path:
    path = folder / "a.csv"
    path.write_text(text)
    return path


def test_a_comment_after_the_numbers_is_no_head(tmp_path: Path) -> None:
    """It has as many cells as the table has columns."""
    text = f"# made by a logger\n# time;speed\n{ROWS}# stopped; by hand\n"
    assert list(read_log(log(tmp_path, text)).columns) == ["time", "speed"]
    with pytest.raises(ScenarioError, match="the first row must name the columns"):
        read_log(log(tmp_path, f"{ROWS}# stopped; by hand\n"))


@pytest.mark.parametrize("mark", [";", ",", "\t", "|"])
def test_the_first_line_of_spreadsheets_says_what_separates(tmp_path: Path, mark: str) -> None:
    text = f"sep={mark}\n" + f"time;speed, measured\n{ROWS}".replace(";", mark)
    heads = f"time{mark}speed, measured".split(mark)
    if mark == ",":  # its head names a column that the rows do not have
        text = text.replace(", measured", "")
        heads = ["time", "speed"]
    found = read_log(log(tmp_path, text))
    assert list(found.columns) == heads
    assert found[heads[1]] == pytest.approx(np.arange(20.0), abs=0.0)


@pytest.mark.parametrize(
    ("row", "units"),
    [
        ("ms;rpm;ticks", ["ms", "rpm", "ticks"]), ("ms;rpm;1", ["ms", "rpm", "1"]),
        ("[ms];-;[ticks]", ["ms", "-", "ticks"]), ("ms;raw;raw", ["ms", "raw", "raw"]),
        ("begin;rpm;on", None), ("1;1;1", None), ("ms;rpm;7", None),
    ],
)  # fmt: skip
def test_a_row_of_units_may_hold_some_that_are_not_known(
    tmp_path: Path, row: str, units: list[str] | None
) -> None:
    rows = "".join(f"{k};{2 * k};{3 * k}\n" for k in range(9))
    found = read_log(log(tmp_path, f"time;speed;enc\n{row}\n{rows}"))
    assert list(found.units.values()) == (units or ["", "", ""])
    assert found["time"].size == (9 if units else 10)


def test_a_row_of_units_above_a_text_is_one(tmp_path: Path) -> None:
    found = read_log(log(tmp_path, "time;speed;note\nms;rpm;\n1;2;ok\n2;3;ok\n"))
    assert found.units == {"time": "ms", "speed": "rpm", "note": ""}
    found = read_log(log(tmp_path, "time;speed;mode\n;;A\n1;2;B\n2;3;B\n"))  # no ampere
    assert found["time"].size == 3 and not any(found.units.values())


@pytest.mark.parametrize("head", ["time;note;u", "note;time;u", "time;u;note"])
def test_a_quotation_mark_that_is_not_closed_takes_in_no_rows(tmp_path: Path, head: str) -> None:
    rows = [{"time": str(k), "u": "1", "note": "ok"} for k in range(40)]
    rows[20]["note"] = '"begin'
    text = "\n".join([head, *(";".join(row[name] for name in head.split(";")) for row in rows)])
    with pytest.raises(ScenarioError, match=r"\"begin.* takes in the 19 rows after it; close it"):
        read_log(log(tmp_path, text))
    rows[22]["note"] = 'end"'
    text = "\n".join([head, *(";".join(row[name] for name in head.split(";")) for row in rows)])
    with pytest.raises(ScenarioError, match=r"takes in the 2 rows after it; close it"):
        read_log(log(tmp_path, text))


def test_cells_and_heads_may_go_over_lines(tmp_path: Path) -> None:
    text = 'sep=;\n"time\n[ms]";"speed\n[rpm]";note\n0;1;"seen;\nand gone"\n1;2;\n'
    found = read_log(log(tmp_path, text))
    assert (found.units["time"], found.units["speed"]) == ("ms", "rpm")
    assert found["speed"].tolist() == [1.0, 2.0]


@pytest.mark.parametrize("mark", [";", "\t", "|", ","])
@pytest.mark.parametrize("ends", [("", "X"), ("X", "X"), ("X", "")])
def test_a_separator_may_end_head_or_rows(tmp_path: Path, mark: str, ends: tuple[str, str]) -> None:
    head, row = (end.replace("X", mark) for end in ends)
    lines = [f"time{mark}u{mark}y{head}", *(mark.join("123") + row for _ in range(9))]
    found = read_log(log(tmp_path, "\n".join(lines)))
    assert [found[name][0] for name in ("time", "u", "y")] == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ("text", "name", "unit"),
    [
        ("rate [1/s]", "rate", "1/s"), ("bend [1/m]", "bend", "1/m"),
        ("speed [1/min]", "speed", "rpm"), ("time [msec]", "time", "ms"),
        ("time [µsec]", "time", "us"), ("time (seconds)", "time (seconds)", "s"),
        ("q[0]", "q[0]", ""), ("q[1/2]", "q[1/2]", ""),
    ],
)  # fmt: skip
def test_units_in_brackets(text: str, name: str, unit: str) -> None:
    assert head(text) == (name, unit)


def test_a_clock_in_a_unit_of_no_time_is_said_and_not_taken_as_seconds(tmp_path: Path) -> None:
    rows = "".join(f"{i},{i % 7},0,{0.01 * i:.2f},0,0\n" for i in range(50))
    heads = "time [{}],left_rpm,right_rpm,x_m,y_m,yaw_rad\n"
    path = log(tmp_path, heads.format("msec") + rows)
    assert inspect(path).topics[0].clock.interval == pytest.approx(1e-3, rel=1e-9)
    path = log(tmp_path, heads.format("ticks") + rows)
    (report,) = inspect(path).topics
    said = "'ticks', as the log says, is no unit of time"
    assert any(f.kind == "unit" and said in f.text for f in report.findings)
    (tmp_path / "robot.toml").write_text(SYSTEM)
    with pytest.raises(InputError, match=said):
        import_logs(
            {"a": [path]}, {"a": "identification"}, Wishes(str(tmp_path / "robot.toml")),
            tmp_path / "set", default_provider(),
        )  # fmt: skip
    assert not (tmp_path / "set").exists()


def test_inspect_takes_the_clock_that_it_asks_for(tmp_path: Path) -> None:
    rows = [f"{0.1 * i + 0.04 * (-1) ** i:.2f},{i % 7}" for i in range(50)]
    path = log(tmp_path, "\n".join(["instant,w", *rows]))
    (report,) = inspect(path).topics
    assert any("--clock" in finding.text for finding in report.findings)
    done = CliRunner().invoke(app, ["data", "inspect", str(path), "--clock", "instant", "--json"])
    (file,) = json.loads(done.stdout)["files"]
    assert file["topics"][0]["clock"]["column"] == "instant"


def test_a_clock_that_no_file_has_is_refused(tmp_path: Path) -> None:
    (tmp_path / "b.csv").write_text("stamp;u\n" + ROWS)
    files = [log(tmp_path, "stamp;instant;w\n" + ROWS.replace("\n", ";1\n")), tmp_path / "b.csv"]
    texts = [str(path) for path in files]
    # one that one of several files has is not
    done = CliRunner().invoke(app, ["data", "inspect", *texts, "--clock", "instant"])
    assert done.exit_code == 0
    done = CliRunner().invoke(app, ["data", "inspect", *texts, "--clock", "instnt"])
    assert done.exit_code and isinstance(done.exception, UnknownNameError)
    assert "did you mean 'instant'?" in str(done.exception)
    (tmp_path / "robot.toml").write_text(SYSTEM)
    wishes = Wishes(str(tmp_path / "robot.toml"), clock="instnt")
    with pytest.raises(UnknownNameError, match="--clock instnt: no log has such a column; did you"):
        import_logs({"a": files}, {"a": "identification"}, wishes, tmp_path / "set",
                    default_provider())  # fmt: skip


def test_what_has_no_clock_of_its_length_is_left_out_of_several(tmp_path: Path) -> None:
    slow, fast = 0.05 * np.arange(40.0), 0.02 * np.arange(100.0)
    np.savez(tmp_path / "a.npz", start=np.ones(3), t_cmd=fast, u_cmd=fast, t_pose=slow,
             x_pose=slow, other=np.append(slow, 9.0)[1:], noise_cmd=np.ones(2))  # fmt: skip
    report = inspect(tmp_path / "a.npz")
    assert {t.topic.name: [c.name for c in t.columns] for t in report.topics} == {
        "cmd": ["u_cmd"], "pose": ["x_pose", "other"],
    }  # fmt: skip
    why = "values, as many as no clock has"
    assert report.source.left == {"start": f"3 {why}", "noise_cmd": f"2 {why}"}


def test_dates_of_an_npz_file_are_a_column(tmp_path: Path) -> None:
    begin = np.datetime64("2025-11-25T03:06:40.250", "ns")
    times = begin + np.arange(50) * np.timedelta64(20, "ms")
    days = np.array([np.datetime64("2025-11-25", "D")] * 49 + [np.datetime64("NaT")])
    odd = np.zeros(50, dtype=complex)
    np.savez(tmp_path / "a.npz", stamp=times, day=days, w=np.arange(50.0), odd=odd)
    (report,) = inspect(tmp_path / "a.npz").topics
    assert report.clock.column == "stamp" and report.clock.unit.unit == "ns"
    assert report.clock.interval == pytest.approx(0.02, rel=1e-9)
    assert report.clock.began() == "2025-11-25 03:06:40.250 UTC"
    assert np.count_nonzero(np.isnan(report.topic.log["day"])) == 1
    assert any("'odd' of type complex128" in f.text for f in report.findings)
