"""Commands that run FMUs, in a fork of this process: a crash there ends with a sentence.

What an FMU does cannot end the waiting process, which says which FMU it was (`master.board`). The
fork is made before anything large is imported.
"""

from __future__ import annotations

import atexit
import contextlib
import mmap
import os
import signal
import sys
import tempfile
import threading
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from ..errors import FmuCallError

COMMANDS = {"calibrate", "diagnose", "linearize", "monitor", "study"}
"""Those whose FMUs run in this process; `run` guards each run, so that it keeps the recording."""
GRACE = 5
"""Time that a command has to put its things away when it is told to end [s]."""
SIZE = 2**22
"""Bytes of shared memory; only those that are written take any."""
HEARD = 16
"""Place in it where a fork says that it ends by itself, behind what the board has for both."""


def applies(arguments: list[str]) -> bool:
    """Whether a command line is one to guard, in a process where a fork is safe."""
    return (
        sys.platform == "linux"
        and bool(arguments)
        and arguments[0] in COMMANDS
        and not {"--help", "--isolate"} & set(arguments)
        and len(os.listdir("/proc/self/task")) == 1  # no other thread can hold a lock
    )


def guarded(work: Callable[[], None]) -> None:
    """Do some work in a fork, and end as it does.

    Raises:
        FmuCallError: an FMU ended the fork.
        SystemExit: with its exit code.
    """
    with tempfile.TemporaryDirectory(prefix="cosim-", ignore_cleanup_errors=True) as name:
        memory = mmap.mmap(-1, SIZE)
        sys.stdout.flush()
        sys.stderr.flush()
        parent, pid = os.getpid(), os.fork()
        if not pid:
            _serve(work, memory, Path(name), parent)
        code = _waited(pid, memory)
        from ..master.board import Board

        board = Board(memory, Path(name))
        if board.finished() and code >= 0:
            raise SystemExit(code)
        raise FmuCallError(board.sentence(code))


def heard() -> None:
    """Say that a signal is no reason to kill this process: it ends by itself, when it has reported.

    Nothing happens where nobody waits.
    """
    if _shared:
        _shared[0][HEARD] = 1


_shared: list[mmap.mmap] = []
"""The memory, in a fork."""


def _waited(pid: int, memory: mmap.mmap) -> int:
    """The code with which a process ends; signals go on to it.

    `timeout` tells the command and its group, so a second SIGTERM is the first.

    Raises:
        SystemExit: it did not end within `GRACE` of a signal (an FMU's call does not return) and
            has not `heard` it, or was interrupted twice, and was killed.
    """
    told: list[int] = []

    def send(number: int) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, number)

    def forward(number: int, _: Any) -> None:
        again = number in told
        told.append(number)
        if not again:
            send(number)
        elif number != signal.SIGTERM:
            send(number if memory[HEARD] else signal.SIGKILL)
        signal.alarm(GRACE)

    def late(_number: int, _frame: Any) -> None:
        if not memory[HEARD] or told.count(signal.SIGINT) > 1:
            send(signal.SIGKILL)

    handlers = {n: forward for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    before = {n: signal.signal(n, h) for n, h in {**handlers, signal.SIGALRM: late}.items()}
    try:
        code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    finally:
        signal.alarm(0)
        for number, handler in before.items():
            second = number == signal.SIGTERM and number in told  # this process ends, too
            signal.signal(number, signal.SIG_IGN if second else handler)
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(pid, signal.SIGKILL)  # what FMUs have started
    if told and code < 0:
        raise SystemExit(128 + told[0])
    return code


def _serve(work: Callable[[], None], memory: mmap.mmap, folder: Path, parent: int) -> NoReturn:
    """The fork: do the work, end the process."""
    code = 1
    try:
        os.setsid()
        _shared.append(memory)
        from ..master.board import Board
        from ..master.isolation_worker import orphaned

        threading.Thread(target=orphaned, args=(parent, folder), daemon=True).start()
        Board(memory, folder).watch()
        try:
            work()
            code = 0
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
        sys.stdout.flush()
        sys.stderr.flush()
        atexit._run_exitfuncs()  # FMUs that it frees may still crash
    except BaseException:
        traceback.print_exc()
    finally:  # an FMU that ends the process does not come here
        memory[0] = 1
        os._exit(code)
