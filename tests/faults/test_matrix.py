"""No fault of an FMU is silent: each ends with an error that names the FMU, or with a note."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import pytest

from tests.faults import matrix
from tests.faults.matrix import FAULTS, Fault, Outcome, outcome

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="the test's FMU is for Linux"),
    pytest.mark.slow,
]


APART = [*{fault.kind: fault for fault in FAULTS if not fault.maker or fault.hangs}.values()]
"""Each kind in one phase: new interpreters take long; the page is written with all."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("faults")


@pytest.fixture(scope="module")
def isolated(folder: Path) -> dict[str, Outcome]:
    # new interpreters start slowly, so some do at a time
    for fault in APART:
        matrix.faulty(folder, fault)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        found = pool.map(lambda fault: outcome(folder, fault, True), APART)
        return {fault.name: item for fault, item in zip(APART, found, strict=True)}


def judge(fault: Fault, found: Outcome) -> None:
    assert bool(found.code) == fault.fails, found
    assert re.search(fault.says, found.text), found
    if fault.says:
        assert f"bad_{fault.name}" in found.text or fault.phase == "archive", found
        assert "good (" not in found.text, found
    if fault.phase in ("set", "get", "step") and fault.fails:
        assert found.rows >= 3, (
            found
        )  # it fails at 0.3 s or behind, where 0, 0.1 and 0.2 s are kept
    if fault.kind == "false":  # pythonfmu's way to ask for the end
        assert found.rows == 3, found
    elif not fault.fails or fault.phase in ("terminate", "free"):
        assert found.rows == 11, found


@pytest.mark.parametrize("fault", APART, ids=lambda fault: fault.name)
def test_no_fault_is_silent_with_isolation(isolated: dict[str, Outcome], fault: Fault) -> None:
    judge(fault, isolated[fault.name])


@pytest.mark.parametrize(
    "fault", [fault for fault in FAULTS if not fault.hangs], ids=lambda fault: fault.name
)
def test_no_fault_is_silent(folder: Path, fault: Fault) -> None:
    before = os.getcwd(), os.umask(0o022)
    judge(fault, outcome(folder, fault, False))
    assert (os.getcwd(), os.umask(before[1])) == (before[0], 0o022)
    assert not [line for line in children() if "cosim.master" in line]


def children() -> list[str]:
    """Command lines of the processes that this one has begun and that have not ended."""
    numbers = [
        n for file in Path("/proc/self/task").glob("*/children") for n in file.read_text().split()
    ]
    found = []
    for number in numbers:
        with suppress(FileNotFoundError):  # it has just ended
            found.append(Path(f"/proc/{number}/cmdline").read_bytes().replace(b"\0", b" ").decode())
    return found


def test_a_child_is_seen() -> None:
    program = [sys.executable, "-c", "print(flush=True); input()  # cosim.master"]
    with subprocess.Popen(program, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as begun:
        begun.stdout.readline()  # it has begun
        assert [line for line in children() if "cosim.master" in line]
        begun.stdin.write(b"\n")


def test_there_are_fifty_faults_and_the_page_has_them_all() -> None:
    assert len({fault.name for fault in FAULTS}) == len(FAULTS) >= 50
    rows = matrix.PAGE.read_text(encoding="utf-8").partition("<!-- table -->")[2].splitlines()
    assert [tuple(row.split(" | ")[:2]) for row in rows[4:]] == [
        (f"| {fault.place}", fault.text) for fault in FAULTS
    ]
