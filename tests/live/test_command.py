"""`cosim twin` from the shell."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.machine import Machine
from cosim.calibrate import read_problem
from cosim.files import claimed
from tests.live.disc import commands, rig

ROOT = Path(__file__).parents[2]


def twin(*arguments: object, given: bytes = b"") -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        [sys.executable, "-m", "cosim", "twin", *map(str, arguments)],
        input=given, capture_output=True, cwd=ROOT,
    )  # fmt: skip


@pytest.mark.slow
def test_lines_in_lines_out_and_a_data_set(tmp_path: Path) -> None:
    reading = rig(tmp_path / "disc")
    machine = Machine(reading, commands(500), {"angle_0": 0.25, "name": "morning"})
    stream = b"\n".join(line for block in machine.lines() for line in block)
    done = twin(
        tmp_path / "disc", "--source", "-", "--pace", "0", "--out", tmp_path / "kept", given=stream
    )
    assert done.returncode == 0, done.stderr
    events = [json.loads(line) for line in done.stdout.splitlines()]
    assert events[0]["event"] == "run"
    assert events[-1]["event"] == "end"
    assert events[-1]["samples"] == 500
    problem = read_problem(tmp_path / "kept")
    assert [run.name for run in problem.runs] == ["morning"]
    assert len(problem.runs[0].times) == 500


@pytest.mark.slow
def test_a_folder_that_another_stream_is_kept_in_is_refused(tmp_path: Path) -> None:
    rig(tmp_path / "disc")
    with claimed(tmp_path / "kept"):
        done = twin(tmp_path / "disc", "--source", "-", "--out", tmp_path / "kept")
    assert done.returncode == 2
    assert b"another run writes its results there" in done.stderr


def test_a_wrong_name_ends_with_exit_code_2() -> None:
    done = twin("motor_bensch", "--source", "-")
    assert done.returncode == 2
    assert b"did you mean 'motor_bench'" in done.stderr
    assert done.stdout == b""
