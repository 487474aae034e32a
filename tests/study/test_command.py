"""`cosim study`: what it prints, writes and returns; schedulers of dask."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from cosim.cli.app import app
from cosim.errors import CosimError, InputError, StudyError
from tests.outside import hear_interrupts
from tests.study.conftest import BASE
from tests.study.test_results import failing, figures

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
SWAP = """
scenario = "motor_bench/ST1"
duration = 0.7
step = 1e-3
[set]
gearbox = ["ratio", "elastic"]
"""


def cosim(*arguments: str) -> Any:
    """The command line in this process; errors are raised."""
    result = CliRunner().invoke(app, ["study", *arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.stderr
    return result


def test_table_and_json(tmp_path: Path) -> None:
    file, out = tmp_path / "swap.toml", tmp_path / "out"
    file.write_text(SWAP)
    said = cosim(str(file), "--out", str(out), "--workers", "2")
    assert "swap: 2 runs, 2 made now, 0 were there, 0 failed" in said.stdout
    for text in ("gearbox", "rms.speed [rad/s]", "fmu_steps", "× real time", "elastic"):
        assert text in said.stdout
    again = json.loads(cosim(str(file), "--out", str(out), "--json").stdout)
    assert {key: again[key] for key in ("runs", "computed", "reused", "failed", "corrupt")} == {
        "runs": 2, "computed": 0, "reused": 2, "failed": 0, "corrupt": []
    }  # fmt: skip
    assert [row["set.gearbox"] for row in again["rows"]] == ["ratio", "elastic"]
    assert [Path(path).name for path in again["files"]] == [
        "study.csv", "study.json", "study.parquet", "study.png"
    ]  # fmt: skip
    written = json.loads((out / "study.json").read_text())
    assert written["rows"] == again["rows"] and again["units"]["rms.speed"] == "rad/s"


def test_many_runs_are_summed_up(tmp_path: Path) -> None:
    file = tmp_path / "many.toml"
    file.write_text(
        SWAP.replace("0.7", "0.02") + '[param]\n"load.J" = { from = 0.07, to = 0.09, count = 21 }\n'
    )
    said = cosim(str(file), "--out", str(tmp_path / "out")).stdout
    assert "medians over the runs of each variant; every run is in study.csv" in said
    assert "worst.rms.speed" in said


def test_failures_and_corrupt_files_are_named(tmp_path: Path, faulty: Path) -> None:
    file = faulty / "study.toml"
    file.write_text('scenario = "scenario.toml"\n[param.bad]\nmode = 1\nfail_at = [0.35, 1e9]\n')
    out = tmp_path / "out"
    with pytest.raises(StudyError, match="1 of 2 runs failed; the others are done") as caught:
        cosim(str(file), "--out", str(out))
    assert caught.value.exit_code == 1
    [note] = caught.value.__notes__
    assert note.startswith("  bad.fail_at=0.35: run stopped at t = 0.3 s: bad (faulty)")
    for path in (out / "runs").glob("*.json"):
        path.write_text("{}")
    process = subprocess.run(
        [sys.executable, "-m", "cosim", "study", str(file), "--out", str(out), "--json"],
        capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert process.returncode == 1
    content = json.loads(process.stdout)  # nothing but JSON
    assert content["failed"] == 1 and len(content["corrupt"]) == 2
    assert process.stderr.count("cannot be used (not a result of a study)") == 2
    assert "error: 1 of 2 runs failed" in process.stderr and "Traceback" not in process.stderr


def isolated(pid: int) -> list[int]:
    """Processes of isolated runs that a process has started."""
    found = []
    for path in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in map(int, path.read_text().split()):
            with suppress(OSError):  # it has ended
                if b"cosim.master.isolation_worker" in Path(f"/proc/{child}/cmdline").read_bytes():
                    found.append(child)
    return found


def wait_for(condition: Callable[[], object]) -> None:
    end = time.monotonic() + 60.0
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)


@pytest.mark.skipif(
    not Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").exists(),
    reason="finds processes by Linux's /proc",
)
@pytest.mark.parametrize("hanging", [False, True])
def test_interrupted_isolated_runs_are_no_failures(
    tmp_path: Path, faulty: Path, hanging: bool
) -> None:
    """While Python starts there the interruption ends it; in an FMU that hangs it does not."""
    file, out = faulty / "hang.toml", tmp_path / "out"
    file.write_text('scenario = "scenario.toml"\n[param.bad]\nmode = 6\nfail_at = 0.35\n')
    process = subprocess.Popen(
        [sys.executable, "-m", "cosim", "study", str(file), "--out", str(out), "--isolate"],
        stderr=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=hear_interrupts,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    try:
        wait_for(lambda: isolated(process.pid))
        [child] = isolated(process.pid)
        if hanging:  # the binary is loaded some milliseconds before the loop
            wait_for(lambda: "faulty.so" in Path(f"/proc/{child}/maps").read_text())
            time.sleep(0.3)
        os.killpg(process.pid, signal.SIGINT)
        _, said = process.communicate(timeout=30)  # half of the time limit of a call
    finally:
        process.kill()
    assert process.returncode == 130 and "interrupted: 0 of 1 runs are done" in said
    assert not Path(f"/proc/{child}").exists()
    assert not list(out.glob("runs/*"))


@pytest.mark.skipif(
    not Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").exists(),
    reason="finds processes by Linux's /proc",
)
def test_a_hanging_fmu_does_not_outlive_a_killed_study(tmp_path: Path, faulty: Path) -> None:
    file, out = faulty / "hang.toml", tmp_path / "out"
    file.write_text('scenario = "scenario.toml"\n[param.bad]\nmode = 6\nfail_at = 0.35\n')
    process = subprocess.Popen(
        [sys.executable, "-m", "cosim", "study", str(file), "--out", str(out), "--isolate"],
        stderr=subprocess.DEVNULL, env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    try:
        wait_for(lambda: isolated(process.pid))
        [child] = isolated(process.pid)
        wait_for(lambda: "faulty.so" in Path(f"/proc/{child}/maps").read_text())
    finally:
        process.kill()
        process.wait()
    wait_for(lambda: not Path(f"/proc/{child}").exists())
    assert not Path(f"/proc/{child}").exists()


def test_wrong_usage(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none.toml: there is no such file"):
        cosim(str(tmp_path / "none.toml"))
    file = tmp_path / "swap.toml"
    file.write_text(SWAP)
    with pytest.raises(InputError, match=r"--fmus .*: there is no such folder"):
        cosim(str(file), "--fmus", str(tmp_path / "nowhere"))


def test_the_example_says_what_it_runs() -> None:
    from cosim.study import read_study

    for path in (ROOT / "scenarios" / "studies").glob("*.toml"):
        assert read_study(path).text


# -- dask ------------------------------------------------------------------------------------------


def test_a_scheduler_needs_dask(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"not installed: pip install 'cosim-robotics\[study\]'"):
        run({}, scheduler="tcp://localhost:1")


@pytest.fixture(scope="module")
def cluster() -> Any:
    distributed = pytest.importorskip("distributed")
    import dask

    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 1}),  # dask's own is 3: slower
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0"
        ) as found,
    ):
        yield found


@pytest.mark.filterwarnings("ignore::Warning:distributed.*", "ignore::ResourceWarning")
def test_workers_of_a_scheduler_give_the_same(
    run: Any, tmp_path: Path, cluster: Any, faulty: Path
) -> None:
    table = {
        "set": {"gearbox": ["ratio", "elastic"]},
        "param": {"load.J": [0.07, 0.08, 0.09]},
        "keep": ["load.w"],
    }
    here = run(table, out=tmp_path / "here")
    there = run(table, out=tmp_path / "there", scheduler=cluster.scheduler_address)
    assert there.computed == 6 and figures(here.table.rows) == figures(there.table.rows)
    for row in here.table.rows:
        first, second = here.recording(row["key"]), there.recording(row["key"])
        assert (first.values == second.values).all()
    study = failing(faulty, "error")
    failed = run(study, out=tmp_path / "failed", scheduler=cluster.scheduler_address)
    assert [row["status"] for row in failed.table.rows] == ["ok", "failed", "ok", "failed"]
    crash = failing(faulty, "crash", param={"bad.mode": 5, "bad.fail_at": 0.35})
    crashed = run(crash, out=tmp_path / "crashed", scheduler=cluster.scheduler_address)
    assert "the workers that made this run died" in crashed.failures[0]["error"]


@pytest.mark.filterwarnings("ignore::Warning:distributed.*", "ignore::ResourceWarning")
def test_a_scheduler_that_does_not_answer(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("cosim.study.parallel.ANSWER", 1.0)
    with pytest.raises(CosimError, match="does not answer"):
        run(BASE, scheduler="tcp://127.0.0.1:9")
