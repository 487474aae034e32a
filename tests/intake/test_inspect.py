"""`cosim data inspect`: what it prints, its JSON, and its picture."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from cosim.cli.app import app
from cosim.cli.data import gathered
from cosim.errors import CosimError, InputError
from cosim.intake.inspect import inspect
from cosim.intake.picture import AXES, draw, groups


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Rpm, mA, ms, an angle that begins anew, a missing cell, text, and two that stand still."""
    time = np.arange(0, 4000, 4)
    chance = np.random.default_rng(0)
    lines = ["stamp_ms,MotSpd(rpm),I_mA,heading,mode,a,b"]
    for k, t in enumerate(time):
        speed = "" if k == 10 else f"{900 * np.sin(t / 500) + chance.normal(0, 3):.1f}"
        turn = (0.3 * t + 180) % 360 - 180
        current = 2000 * np.sin(t / 300) + chance.normal(0, 9)
        lines.append(f"{40_000_000 + t},{speed},{current:.0f},{turn:.2f},on,0,1")
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines))
    return path


def run(*args: str) -> str:
    done = CliRunner().invoke(app, ["data", "inspect", *args], catch_exceptions=False)
    assert done.exit_code == 0
    return done.stdout


def test_json(log: Path) -> None:
    (file,) = json.loads(run(str(log), "--json"))["files"]
    (topic,) = file["topics"]
    clock = topic["clock"]
    assert (clock["column"], clock["unit"]) == ("stamp_ms", "ms")
    assert clock["rate_hz"] == pytest.approx(250.0)
    columns = {c["name"]: c for c in topic["columns"]}
    assert {n: (c["unit"], c["sure"]) for n, c in columns.items()} == {
        "MotSpd(rpm)": ("rpm", True), "I_mA": ("mA", True), "heading": ("deg", False),
        "a": ("", False), "b": ("", False),
    }  # fmt: skip
    assert columns["MotSpd(rpm)"]["missing"] == 1
    # the deviation of the estimate is 1.2 / sqrt(1000 / 8); rounding adds little
    assert columns["I_mA"]["noise"] == pytest.approx(9.0, rel=0.3)
    assert {(f["kind"], f["column"]) for f in topic["findings"]} == {
        ("gaps", "MotSpd(rpm)"), ("wrapped", "heading"), ("reading", "mode"), ("constant", "a"),
        ("constant", "b"),
    }  # fmt: skip


def test_the_table_marks_what_is_guessed(log: Path) -> None:
    text = run(str(log))
    assert "log.csv (CSV): 1000 rows, 250 Hz for 3.996 s" in text
    assert "deg (guessed)" in text and "rpm (guessed)" not in text
    assert "note: heading: begins anew at a turn of 360 deg, 3 times" in text


def test_the_same_of_several_columns_is_said_once(log: Path) -> None:
    findings = inspect(log).topics[0].findings
    again = [f for f in gathered([*findings, *findings]) if f.kind == "constant"]
    assert [f.column for f in again] == ["a, a", "b, b"]  # 0 and 1 are not the same


def test_a_picture_has_eight_axes_at_most_and_names_what_is_not_in_it(tmp_path: Path) -> None:
    time = 0.01 * np.arange(300)
    names = [f"thing_{letter}" for letter in "abcdefghijk"]
    columns = {name: np.sin(time * k) for k, name in enumerate(names, 2)}
    np.savez(tmp_path / "x.npz", time=time, still=0 * time, **columns)
    report = inspect(tmp_path / "x.npz")
    assert len(groups([report])) == len(names)  # of unknown unit each; what stands still is none
    path, left = draw([report], tmp_path / "x.png")
    assert path.read_bytes().startswith(b"\x89PNG")
    assert left == [f"x.npz: {name}" for name in names[AXES:]]


def test_a_clock_can_be_named(tmp_path: Path) -> None:
    time = np.cumsum(np.random.default_rng(1).exponential(0.01, 200))
    np.savez(tmp_path / "x.npz", a=np.sin(time), when=time)
    assert inspect(tmp_path / "x.npz").topics[0].clock.column == ""
    assert inspect(tmp_path / "x.npz", clock="when").topics[0].clock.column == "when"


def test_what_is_no_log_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.doc").write_text("")
    for path, said in ((tmp_path / "x.doc", "of no known kind; logs are .csv"),
                       (tmp_path, "is a folder without metadata.yaml"),
                       (tmp_path / "y.csv", "there is no such file")):  # fmt: skip
        with pytest.raises(CosimError, match=said):
            inspect(path)
    done = CliRunner().invoke(app, ["data", "inspect", "x.csv", "--plot", "x.gif"])
    assert isinstance(done.exception, InputError) and ".png, .svg, .pdf" in str(done.exception)
