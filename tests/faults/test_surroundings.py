"""What belongs to the process and FMUs change."""

from __future__ import annotations

import subprocess
import sys

import pytest

from cosim.fmu.surroundings import Surroundings

ENABLED = (
    "import ctypes, faulthandler, signal\n"
    "from cosim.fmu.surroundings import Surroundings, _handlers\n"
    "faulthandler.enable()\n"
    "put = ctypes.pythonapi.PyOS_setsig\n"
    "put.argtypes = [ctypes.c_int, ctypes.c_void_p]\n"
    "before = Surroundings.now()\n"
)


def said(text: str) -> str:
    process = subprocess.run([sys.executable, "-c", ENABLED + text], capture_output=True, text=True)
    assert process.returncode == 0, process.stderr
    return process.stdout


def test_a_handler_that_an_fmu_set_is_put_back() -> None:
    text = "put(int(signal.SIGSEGV), int(signal.SIG_IGN))\n"
    text += "print(before.restore(), Surroundings.now() == before)"
    assert said(text) == "['what happens at SIGSEGV'] True\n"


@pytest.mark.parametrize("number", ["SIGSEGV", "SIGFPE"])
def test_a_fault_handler_that_reports_a_crash_is_left_alone(number: str) -> None:
    # it goes back to the default before it reports, in whichever thread the crash is; put back by
    # another thread it would report without end
    text = f"put(int(signal.{number}), None)\n"
    text += "print(before.restore(), None in _handlers())"
    assert said(text) == "[] True\n"


def test_an_interruption_ignored_by_an_fmu_is_put_back() -> None:
    text = "put(int(signal.SIGINT), None)\nprint(before.restore(), Surroundings.now() == before)"
    assert said(text) == "['what happens at SIGINT'] True\n"


def test_what_is_unchanged_is_not_named() -> None:
    assert Surroundings.now().restore() == []
