"""Commands that run FMUs in many sessions: what crashes there is named, and nothing is left."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cosim.cli.guard import HEARD, SIZE
from cosim.master import board, witness
from tests.faults import matrix
from tests.outside import hear_interrupts

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="forks, and an FMU for Linux")
DATA = """
system = "pair.toml"
step = 0.1
[channels]
y = { signal = "good.y", sigma = 0.1 }
[[parameter]]
name = "u"
nominal = 0.1
min = 0.0
max = 1.0
targets = "good.u"
"""
COMMANDS = {
    "calibrate": ["calibrate", ".", "--samples", "0"],
    "diagnose": ["diagnose", "."],
    "linearize": ["linearize", "scenario.toml", "--at", "0.5"],
    "study": ["study", "study.toml"],
}


def prepare(folder: Path, fault: str) -> None:
    """Files for all commands, of a pair of which one has a fault."""
    fmu = matrix.build(folder)
    (folder / "pair.toml").write_text(
        f'connections = ["good.y -> bad_{fault}.u"]\n[instances]\n'
        f'good = "{fmu}"\nbad_{fault} = "{fmu}"\n'
    )
    (folder / "scenario.toml").write_text(
        'description = "x"\nsystem = "pair.toml"\nduration = 1.0\nstep = 0.1\n'
    )
    (folder / "study.toml").write_text(
        'scenario = "scenario.toml"\n[param]\n"good.u" = [0.0, 0.1, 0.2, 0.3]\n'
    )
    runs = ""
    for name, purpose in (("one", "identification"), ("two", "validation")):
        noise = [((7 * i + len(name) * (i % 5)) % 11 - 5) / 50.0 for i in range(101)]
        if name == "two":
            noise = noise[::-1]
        rows = [f"{0.1 * i:.1f},{0.4 + 0.1 * i + noise[i]:.4f}" for i in range(101)]
        (folder / f"{name}.csv").write_text("\n".join(["time,y", *rows]))
        runs += f'[[run]]\nname = "{name}"\nfile = "{name}.csv"\npurpose = "{purpose}"\n'
    (folder / "dataset.toml").write_text(DATA + runs)


def start(folder: Path, words: list[str]) -> subprocess.Popen[str]:
    temporary = folder / "temporary"
    temporary.mkdir()
    return subprocess.Popen(
        [sys.executable, "-m", "cosim", *words],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder,
        env={**os.environ, "TMPDIR": str(temporary)},
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "fault", "says"),
    [
        ("calibrate", "step_segv", "in a step, crashed (signal SIGSEGV)"),
        ("diagnose", "init_exit0", "in initialization, ended the process with exit code 0"),
        ("linearize", "free_abort", "in being freed, crashed (signal SIGABRT)"),
        ("study", "set_segv", "in taking inputs, crashed (signal SIGSEGV)"),
    ],
)
def test_the_fmu_that_ended_a_command_is_named(
    tmp_path: Path, name: str, fault: str, says: str
) -> None:
    prepare(tmp_path, fault)
    process = start(tmp_path, COMMANDS[name])
    _, errors = process.communicate(timeout=120.0)
    assert process.returncode == 1, errors
    last = errors.strip().splitlines()[-1]
    assert last.startswith(f"error: bad_{fault} ({tmp_path / 'faulty.fmu'}), {says}"), errors
    assert "good (" not in errors and "Traceback" not in errors
    assert not list((tmp_path / "temporary").iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["calibrate", "study"])
def test_a_command_whose_fmus_are_right_ends_as_ever(tmp_path: Path, name: str) -> None:
    prepare(tmp_path, "step_prints")
    process = start(tmp_path, [*COMMANDS[name], "--json"])
    shown, errors = process.communicate(timeout=120.0)
    assert process.returncode == 0, errors
    json.loads(shown)
    assert "crashed" not in errors
    assert not list((tmp_path / "temporary").iterdir())


def test_wrong_input_is_one_sentence_with_its_own_code(tmp_path: Path) -> None:
    process = start(tmp_path, ["calibrate", "nowhere"])
    shown, errors = process.communicate(timeout=120.0)
    assert (process.returncode, shown) == (2, "")
    assert errors.startswith("error: nowhere: there is no such folder") and "FMU" not in errors


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_an_ended_command_leaves_nothing(tmp_path: Path, number: signal.Signals) -> None:
    prepare(tmp_path, "step_hang")
    process = start(tmp_path, COMMANDS["linearize"])
    temporary = tmp_path / "temporary"
    end = time.monotonic() + 60.0
    while not any(temporary.glob("*/0/members")):  # a run was made
        assert time.monotonic() < end
        time.sleep(0.05)
    time.sleep(0.3)
    (child,) = children(process.pid)
    process.send_signal(number)
    process.communicate(timeout=60.0)
    assert process.returncode == {15: 143, 9: -9}[number]
    while any(temporary.iterdir()) or Path(f"/proc/{child}").exists():
        assert time.monotonic() < end
        time.sleep(0.05)


def children(pid: int) -> list[int]:
    found = subprocess.run(
        ["pgrep", "-P", str(pid)], capture_output=True, text=True, check=False
    ).stdout
    return [int(line) for line in found.split()]


def test_what_is_guarded() -> None:
    text = (
        "from cosim.cli.app import applies\n"
        f"print([applies([name]) for name in {sorted(COMMANDS)!r}], applies([]), applies(['run']),"
        " applies(['study', '--help']), applies(['study', 'x', '--isolate']))\n"
        "import threading, time\n"
        "threading.Thread(target=time.sleep, args=(0.5,)).start()\n"
        "print(applies(['study']))"
    )
    found = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    # as a command begins it has one thread; with others a fork is not safe
    assert found.stdout.splitlines() == [
        "[True, True, True, True] False False False False",
        "False",
    ]


TOLD = """
import os, signal, sys, time
from cosim.cli import guard
from cosim.cli.signals import taken

def work():
    def told():
        print("told", flush=True)
        if {heard}:
            guard.heard()
    with taken(signal.SIGTERM, told), taken(signal.SIGINT, told):
        print("begun", flush=True)
        end = time.monotonic() + {seconds}
        while time.monotonic() < end:
            time.sleep(0.1)
    print("reported", flush=True)

guard.GRACE = 1
try:
    guard.guarded(work)
finally:
    print("ended", flush=True)
    time.sleep({after})
"""
"""A command that takes a while to end once it is told to."""


def told(heard: bool, seconds: float, numbers: list[signal.Signals]) -> tuple[int, list[str]]:
    """Exit code and words of a command that gets signals, a moment apart."""
    text = TOLD.format(heard=heard, seconds=seconds, after=0.0)
    with subprocess.Popen(
        [sys.executable, "-c", text], stdout=subprocess.PIPE, text=True, preexec_fn=hear_interrupts
    ) as process:
        assert process.stdout is not None
        begun = process.stdout.readline()
        for number in numbers:
            process.send_signal(number)
            time.sleep(0.3)
        rest, _ = process.communicate(timeout=60.0)
    return process.returncode, [begun.strip(), *rest.split()[:-1]]


def test_a_command_that_has_heard_reports_as_long_as_it_takes() -> None:
    assert told(True, 3.0, [signal.SIGINT]) == (0, ["begun", "told", "reported"])


def test_a_second_sigterm_is_the_first() -> None:
    """`timeout` sends its signal to the command and to its group."""
    assert told(True, 3.0, [signal.SIGTERM] * 2) == (0, ["begun", "told", "reported"])


def test_so_it_is_where_the_report_was_quicker() -> None:
    text = TOLD.format(heard=True, seconds=0.1, after=1.0)
    with subprocess.Popen(
        [sys.executable, "-c", text], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if line.strip() in ("begun", "ended"):
                process.send_signal(signal.SIGTERM)
    assert process.returncode == 0


def test_one_that_has_not_is_killed() -> None:
    assert told(False, 30.0, [signal.SIGTERM]) == (143, ["begun", "told"])


def test_a_second_interrupt_ends_one_that_reports() -> None:
    assert told(True, 30.0, [signal.SIGINT] * 2) == (130, ["begun", "told", "told"])


def test_the_memory_holds_what_is_said() -> None:
    assert board.SIZE <= SIZE  # it is made before anything large is imported
    assert board._EXITING < HEARD // 8 < board.HEAD // 8
    made = board.kernel.structures.RUN_SIZE + witness.TEXT + 8 * (board.THREAD + 1)
    assert made <= board.SLOT
