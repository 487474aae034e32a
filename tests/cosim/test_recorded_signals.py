"""What of a run is recorded, and how a recording is asked for it."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

import cosim
from cosim.cli.app import app
from cosim.data.recording import read_recording
from cosim.errors import InputError, UnknownNameError

SHORT = {"duration": 0.02}


def test_a_run_records_further_signals(tmp_path: Path) -> None:
    usual = cosim.run("motor_bench/ST1", **SHORT).recording
    assert "gearbox.tau_a" not in usual
    with pytest.raises(UnknownNameError, match=r'record=\["gearbox.tau_a"\]'):
        usual["gearbox.tau_a"]
    more = cosim.run("motor_bench/ST1", record=["gearbox.tau_a", "load.w"], **SHORT).recording
    assert set(more) == {*usual, "gearbox.tau_a"}
    assert more["load.w"].tolist() == usual["load.w"].tolist()
    arguments = ["run", "motor_bench/ST1", "--duration", "0.02", "--record", "gearbox.tau_a",
                 "--out", str(tmp_path)]  # fmt: skip
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    kept = read_recording(next(tmp_path.rglob("recording.parquet")))
    assert kept["gearbox.tau_a"].tolist() == more["gearbox.tau_a"].tolist()
    with cosim.open("motor_bench/ST1", record=["gearbox.tau_a"]) as twin:
        assert "gearbox.tau_a" in twin.recorded


def test_signals_to_record_are_checked_before_the_run() -> None:
    with pytest.raises(UnknownNameError, match="did you mean"):
        cosim.run("motor_bench/ST1", record=["gearbox.tau_aa"], **SHORT)
    with pytest.raises(InputError, match=r'signals to record .* write record=\["motor.i"\]'):
        cosim.run("motor_bench/ST1", record="motor.i", **SHORT)


def test_a_recording_is_asked_like_a_data_frame() -> None:
    recording = cosim.run("motor_bench/ST1", **SHORT).recording
    assert "load.w" in recording and "load.x" not in recording and 3 not in recording
    assert list(recording) == list(recording.names) and len(recording) == len(recording.time)
    (axis,) = recording.plot("load.w").axes
    assert [line.get_label() for line in axis.get_lines()] == ["load.w"]
    with pytest.raises(InputError, match="by name"):
        recording["load.w", "motor.u"]  # type: ignore[index]
