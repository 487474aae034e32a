"""What the commands say while they work: bars on a terminal, few lines elsewhere."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path

import pytest

from cosim.calibrate.mapping import read_problem
from cosim.cli import app as cli
from cosim.cli import progress
from cosim.cli.progress import Display
from cosim.errors import ScenarioError, UnknownNameError
from cosim.installation.builder import Builder


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def test_elsewhere_a_line_comes_every_few_seconds(
    clock: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    with Display() as display:
        for second in range(21):
            clock[0] = 100.0 + second
            display.update("fitting", second, 20.0, count=f"{second} of 20")
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines() == [
        "fitting: 5 of 20, about 15 s left", "fitting: 10 of 20, about 10 s left",
        "fitting: 15 of 20, about 5 s left", "fitting: 20 of 20",
    ]  # fmt: skip


def test_what_does_not_change_is_said_once(
    clock: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    with Display() as display:
        for text in ("round 1", "round 1", "round 2"):
            clock[0] += 6.0
            display.update("diagnosing", 0.0, text=text)
    assert capsys.readouterr().err.splitlines() == ["round 1", "round 2"]


def test_what_is_quick_says_nothing(clock: list[float], capsys: pytest.CaptureFixture[str]) -> None:
    with Display() as display:
        display.update("run", 0.0, 1.0)
        clock[0] += 4.9
        display.update("run", 1.0, 1.0)
    assert capsys.readouterr() == ("", "")


def test_a_terminal_shows_bars_and_lines_that_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    with Display() as display:
        display.building("gearbox/elastic[x]", 2, 7)
        display.say("round 1: [82] candidates")
        display._bars.refresh()
    text = terminal.getvalue()
    assert "building gearbox/elastic[x]" in text and "2 of 7 FMUs" in text
    assert "round 1: [82] candidates\n" in text


def test_builds_are_counted(tmp_path: Path) -> None:
    said: list[tuple[str, int, int]] = []
    builder = Builder(tmp_path, lambda *told: said.append(told))
    names = ["gearbox/ratio", "inertia/disc", "gearbox/none"]
    builder.prepare(names)
    assert said[0] == ("gearbox/ratio", 0, 2) and said[-1] == ("", 2, 2)
    said.clear()
    builder.expect([*names[:2], "encoder/ideal"])
    builder.path("gearbox/ratio")
    assert said == []  # it is there
    builder.path("encoder/ideal")
    assert said == [("encoder/ideal", 0, 1), ("", 1, 1)]


def test_json_stays_alone_and_progress_goes_elsewhere(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(progress, "EVERY", 0.0)
    monkeypatch.chdir(tmp_path)
    arguments = ["cosim", "run", "motor_bench/ST1", "--duration", "2", "--step", "5e-6"]
    arguments += ["--json"]  # a run of some tenths of a second: it is looked at every twentieth
    monkeypatch.setattr(sys, "argv", arguments)
    with pytest.raises(SystemExit) as end:
        cli.main()
    assert not end.value.code
    out, err = capfd.readouterr()
    assert json.loads(out)["scenario"] == "motor_bench/ST1"
    assert "motor_bench/ST1: " in err and "%" in err


def test_data_sets_and_mappings_have_names(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    named = read_problem("MB-12", mapping="motor_bench")
    assert named.name == "MB-12" and [run.name for run in named.runs] == ["ST1", "MX1"]
    with pytest.raises(UnknownNameError, match=r"no data set of this name .* 'MB-12'"):
        read_problem("MB12")
    with pytest.raises(UnknownNameError, match="no mapping 'emp'; did you mean 'emps'"):
        read_problem("MB-12", mapping="emp")
    (tmp_path / "logs").mkdir()
    with pytest.raises(ScenarioError, match="log/x: there is no such folder"):
        read_problem("log/x")
    with pytest.raises(UnknownNameError, match="did you mean 'logs'"):
        read_problem("log")
