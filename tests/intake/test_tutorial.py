"""The commands of docs/own_logs.md do what the page says."""

from __future__ import annotations

import importlib.util
import json
import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cosim.cli.app import app

PAGE = (Path(__file__).parents[2] / "docs" / "own_logs.md").read_text("utf-8")
COMMANDS = [line.removeprefix("    $ ") for line in PAGE.splitlines() if line.startswith("    $ ")]


@pytest.mark.slow
def test_the_commands_of_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    bags = importlib.util.find_spec("rosbags") is not None
    ran = []
    for command in COMMANDS:
        name, *args = shlex.split(command)
        assert name == "cosim"
        if args[0] == "diagnose" or ("_bag" in command and not bags):
            continue
        done = CliRunner().invoke(app, args, catch_exceptions=False)
        assert done.exit_code == 0, done.output
        ran.append(command)
        # a table of the page, numbers apart, is what is printed
        for row in re.findall(r"^│ (?:pose|base)\..*$", done.stdout, flags=re.M):
            if "import" in command and "_bag" not in command:
                assert row.split("│")[1:5] == _row(row.split("│")[1]).split("│")[1:5]
    assert len(ran) == (6 if bags else 4)
    assert Path("run_1.png").stat().st_size > 10_000
    (calibrated,) = Path("out").glob("*/calibration.json")
    assert "clock of pose" in json.loads(calibrated.read_text())["clocks"]


def _row(cell: str) -> str:
    (row,) = [line for line in PAGE.splitlines() if line.startswith(f"│{cell}│")]
    return row
