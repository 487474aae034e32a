"""`cosim run` with FMUs that fail: exit codes, nothing left over, folders in use."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cosim.data.recording import read_recording
from cosim.errors import InputError
from cosim.files import claimed
from tests.faults import matrix

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the test's FMU is for Linux")


def scenario(folder: Path, fault: str) -> Path:
    fmu = matrix.build(folder)
    (folder / "pair.toml").write_text(
        f'connections = ["good.y -> bad_{fault}.u"]\n[instances]\n'
        f'good = "{fmu}"\nbad_{fault} = "{fmu}"\n'
    )
    path = folder / "scenario.toml"
    path.write_text('description = "x"\nsystem = "pair.toml"\nduration = 1.0\nstep = 0.1\n')
    return path


def command(folder: Path, *words: str) -> subprocess.Popen[str]:
    temporary = folder / "temporary"
    temporary.mkdir()
    return subprocess.Popen(
        [sys.executable, "-m", "cosim", "run", str(folder / "scenario.toml"), *words],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder,
        env={**os.environ, "TMPDIR": str(temporary)},
        # a shell's background jobs ignore it, and hand that on
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "text"),
    [
        ("step_exit0", "ended the process with exit code 0"),
        ("step_segv", "crashed (signal SIGSEGV"),
    ],
)
def test_a_command_survives_its_fmus(tmp_path: Path, fault: str, text: str) -> None:
    scenario(tmp_path, fault)
    process = command(tmp_path, "--out", "out")
    _, errors = process.communicate(timeout=120.0)  # a second on an idle machine
    assert process.returncode == 1
    assert f"bad_{fault} (" in errors and text in errors and "Traceback" not in errors
    recording = read_recording(tmp_path / "out" / "recording.parquet")
    assert recording.error in " ".join(errors.split()) and recording.time[-1] >= 0.2
    assert not list((tmp_path / "temporary").iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("words", [[], ["--isolate"]], ids=["fork", "isolated"])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
def test_an_ended_command_leaves_nothing(
    tmp_path: Path, number: signal.Signals, words: list[str]
) -> None:
    scenario(tmp_path, "step_hang")
    temporary = tmp_path / "temporary"
    process = command(tmp_path, *words)
    until(lambda: any(temporary.iterdir()))
    time.sleep(0.5)  # into the run; any other moment is as good
    process.send_signal(number)
    process.communicate(timeout=60.0)
    assert process.returncode == {15: 143, 2: 130, 9: -9}[number]
    until(lambda: not any(temporary.iterdir()))  # a killed one is noticed within 0.2 s


def until(condition: object) -> None:
    end = time.monotonic() + 60.0
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.mark.slow
def test_what_an_fmu_changed_is_said(tmp_path: Path) -> None:
    scenario(tmp_path, "create_chdir")
    process = command(tmp_path, "--json", "--out", "out")
    shown, _ = process.communicate(timeout=120.0)
    assert process.returncode == 0
    (note,) = json.loads(shown)["notes"]
    assert note.startswith("bad_create_chdir (faulty): changed the working directory to /")
    assert (tmp_path / "out" / "result.json").is_file()


def test_a_folder_in_use_is_refused(tmp_path: Path) -> None:
    with claimed(tmp_path / "out"):
        again = claimed(tmp_path / "out")
        with pytest.raises(InputError, match=r"out: another run writes its results there"), again:
            pass
        with claimed(tmp_path / "other"):
            pass
    with claimed(tmp_path / "out"):
        pass
    assert not (tmp_path / "out").exists()  # it stayed empty
