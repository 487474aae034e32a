"""Nothing that was finished is lost or made again; what cannot be trusted is made again."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from cosim.study import read_study, run_study, study_from
from tests.outside import hear_interrupts

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
LOADS = {"param": {"load.J": [0.07, 0.08, 0.09]}}
LONG = """
scenario = "motor_bench/ST1"
step = 2e-5
[param]
"load.J" = { from = 0.07, to = 0.09, count = 8 }
"""


def files(folder: Path) -> dict[str, int]:
    """Result files and when they were written."""
    paths = folder.glob("runs/[!.]*.json")  # a killed process leaves a temporary file
    return {path.name: path.stat().st_mtime_ns for path in paths}


def figures(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows without what differs from time to time: the cost."""
    cost = ("wall", "cpu", "x_real_time")
    return [{k: v for k, v in row.items() if k not in cost} for row in rows]


def stopped(file: Path, out: Path, least: int, number: int) -> tuple[int, str]:
    """Start a study, send it a signal when `least` results are there."""
    command = [sys.executable, "-m", "cosim", "study", str(file), "--out", str(out)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        [*command, "--workers", "1"], stderr=subprocess.PIPE, text=True, env=environment,
        preexec_fn=hear_interrupts,
    )  # fmt: skip
    end = time.monotonic() + 60.0
    while len(files(out)) < least and process.poll() is None and time.monotonic() < end:
        time.sleep(0.005)
    process.send_signal(number)
    _, said = process.communicate(timeout=30)
    return process.returncode, said


@pytest.mark.skipif(sys.platform == "win32", reason="sends signals of POSIX")
def test_killed_half_way_computes_only_what_is_missing(tmp_path: Path, provider: Any) -> None:
    file, out = tmp_path / "long.toml", tmp_path / "out"
    file.write_text(LONG)
    code, said = stopped(file, out, 2, signal.SIGINT)
    first = files(out)
    assert code == 130 and 2 <= len(first) < 8
    assert f"interrupted: {len(first)} of 8 runs are done and kept in {out}" in said
    assert "Traceback" not in said
    code, _ = stopped(file, out, len(first) + 2, signal.SIGKILL)
    second = files(out)
    assert code == -signal.SIGKILL and len(first) + 2 <= len(second) < 8
    result = run_study(read_study(file), out=out, provider=provider, warn=pytest.fail)
    third = files(out)
    assert len(third) == 8 and not result.failures and not result.corrupt
    assert (result.reused, result.computed) == (len(second), 8 - len(second))
    assert second.items() <= third.items() and first.items() <= second.items()
    assert result.table.rows == json.loads((out / "study.json").read_text())["rows"]
    assert [row["param.load.J"] for row in result.table.rows] == pytest.approx(
        [0.07 + 0.02 * i / 7 for i in range(8)]
    )
    # a run that was made after the kill is the same as one made in one go
    made = next(row for row in result.table.rows if f"{row['key']}.json" not in second)
    alone = run_study(
        study_from(
            {
                "scenario": "motor_bench/ST1", "step": 2e-5,
                "param": {"load.J": made["param.load.J"]},
            }
        ),
        out=tmp_path / "alone", provider=provider, picture=False,
    )  # fmt: skip
    assert figures(alone.table.rows) == figures([made])


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-200])


def emptied(path: Path) -> None:
    path.write_bytes(b"")


def changed(path: Path) -> None:
    text = path.read_text()
    assert '"fmu_steps": 2800' in text
    path.write_text(text.replace('"fmu_steps": 2800', '"fmu_steps": 2801'))


def foreign(path: Path) -> None:
    path.write_text('{"format": "something else"}')


def swapped(path: Path) -> None:
    other = next(item for item in path.parent.glob("*.json") if item != path)
    shutil.copy(other, path)


@pytest.mark.parametrize(
    ("damage", "text"),
    [
        (cut, "not JSON, or cut off after"),
        (emptied, "not JSON, or cut off after 0 bytes"),
        (changed, "its content does not fit its checksum"),
        (foreign, "not a result of a study"),
        (swapped, "it is the result of run "),
    ],
)
def test_a_file_that_cannot_be_trusted_is_set_aside_and_made_again(
    run: Any, damage: Callable[[Path], None], text: str
) -> None:
    before = run(LOADS)
    path = before.folder / "runs" / f"{before.table.rows[1]['key']}.json"
    damage(path)
    damaged, others = path.read_bytes(), files(before.folder)
    after = run(LOADS)
    assert (after.computed, after.reused) == (1, 2)
    [warning] = run.warnings
    assert warning.startswith(f"{path}: cannot be used ({text}") and "made again" in warning
    aside = path.with_name(path.name + ".corrupt")
    assert after.corrupt == (aside,) and aside.read_bytes() == damaged
    assert figures(after.table.rows) == figures(before.table.rows)
    again = files(before.folder)
    assert {name for name in others if again[name] != others[name]} == {path.name}
    damage(path)
    third = run(LOADS)
    assert third.corrupt == (path.with_name(f"{path.name}.2.corrupt"),)  # nothing is overwritten


@pytest.mark.parametrize("remove", [True, False])
def test_a_damaged_recording_is_noticed(run: Any, remove: bool) -> None:
    table = {**LOADS, "keep": ["load.w"]}
    before = run(table)
    key = before.table.rows[2]["key"]
    path = before.folder / "runs" / f"{key}.parquet"
    content = path.read_bytes()
    if remove:
        path.unlink()
    else:
        path.write_bytes(content[:100] + bytes([content[100] ^ 1]) + content[101:])
    after = run(table)
    assert after.computed == 1
    [warning] = run.warnings
    what = "is missing" if remove else "was changed or cut off"
    assert f"its recording {path.name} {what}" in warning
    assert (after.recording(key)["load.w"] == before.recording(key)["load.w"]).all()


def test_other_parameters_compute_only_the_changed_runs(run: Any) -> None:
    first = run(LOADS)
    assert (first.computed, first.reused) == (3, 0)
    second = run({"param": {"load.J": [0.07, 0.085, 0.09, 0.10]}})
    assert (second.computed, second.reused) == (2, 2)
    third = run(LOADS)  # results of the study as it was are still there
    assert (third.computed, third.reused) == (0, 3)
    assert third.table.rows == first.table.rows


@pytest.mark.parametrize(
    "change",
    [
        {"step": 5e-4}, {"duration": 0.2}, {"algorithm": "gauss_seidel"}, {"repeats": 2},
        {"algorithm": {"name": "jacobi", "extrapolation": 1}}, {"keep": ["load.w"]},
        {"set": {"gearbox": "lossy"}}, {"scenario": "motor_bench/MX1"}, {"reuse": False},
    ],
)  # fmt: skip
def test_everything_that_determines_a_run_makes_it_another(run: Any, change: Any) -> None:
    before = run(LOADS)
    assert run({**LOADS, **change}).computed == 3
    assert run(LOADS).table.rows == before.table.rows


def test_what_does_not_determine_a_run_leaves_it(run: Any) -> None:
    run(LOADS)
    same = {
        "description": "other words",
        "algorithm": ["jacobi"],  # the scenario's own
        "param": {"load": {"J": [0.07, 0.08, 0.09]}},
        "scenario": ["motor_bench"],
        "runs": ["ST1"],
    }
    assert run(same).computed == 0
    whole = {"param": {"load.J": [1, 2.0]}}
    run(whole)
    assert run({"param": {"load.J": [1.0, 2]}}).computed == 0


def test_changed_data_and_scenarios_make_other_runs(tmp_path: Path, provider: Any) -> None:
    """Numbers of inputs and references count, texts do not."""
    folder = tmp_path / "bench"
    folder.mkdir()
    shutil.copytree(ROOT / "scenarios" / "motor_bench" / "data", folder / "data")
    path = folder / "scenario.toml"
    text = (ROOT / "scenarios" / "motor_bench" / "scenario.toml").read_text()
    path.write_text(text)
    table = {"scenario": "bench/scenario.toml", "runs": ["ST1"], "duration": 0.1, "step": 1e-3}
    study = study_from(table, "study", tmp_path)

    def computed(content: str) -> int:
        path.write_text(content)
        return run_study(study, out=tmp_path / "out", provider=provider, picture=False).computed

    assert computed(text) == 1
    assert computed("# a comment\n" + text.replace('"current"]\nnames', '"current"]\nnames')) == 0
    assert computed(text.replace('column = "speed_set"', 'column = "speed"')) == 1
    scaled = text.replace('"motor.i_measured", data', '"motor.i_measured", scale = 1.01, data')
    assert scaled != text and computed(scaled) == 1
    assert computed(text) == 0


def test_left_over_temporary_files_go(run: Any) -> None:
    folder = run(LOADS).folder / "runs"
    old, new = folder / ".abc-1.json", folder / ".abc-2.json"
    for path in (old, new):
        path.write_text("half")
    os.utime(old, (time.time() - 3600,) * 2)
    run(LOADS)
    assert not old.exists() and new.exists()  # another process may be writing the new one
