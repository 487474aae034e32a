"""Sessions in other processes, for FMUs that hold Python's lock: threads run those one by one.

    sessions = Workers(4)
    session = Elsewhere(master.outline(10.0, record=["fan.w"]), sessions)
    times, rows = session.run({"fan.k": 4e-6})

Whichever process is free runs what is asked; the same request gives the same bits in each. An error
comes back as one. A process that an FMU has ended is named, and the next request gets another.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import pickle
import queue
import struct
import subprocess
import sys
import weakref
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ..data.signals import Constant
from ..errors import FmuCallError
from ..system.system import System
from . import elsewhere_worker as worker
from .isolation import reason
from .outline import Outline

Vector = NDArray[np.float64]
PROGRAM = f"from {worker.__name__} import main; main()"


def locked(system: System) -> bool:
    """Whether an FMU of the system runs in Python (pythonfmu), so that threads gain nothing.

    Not where Python is inside another program, that could not be started anew.
    """
    return bool(sys.executable) and any(
        (member.fmu.folder / "resources" / "slavemodule.txt").is_file()
        for member in system.members.values()
    )


class _Process:
    """One other process, and which sessions it was told of."""

    def __init__(self) -> None:
        home = str(Path(__file__).resolve().parents[2])
        paths = [home, *filter(None, [os.environ.get("PYTHONPATH")])]
        self.popen = subprocess.Popen(
            [sys.executable, "-c", PROGRAM], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            start_new_session=True,  # Ctrl-C is for who asks; the end of its input ends this one
        )  # fmt: skip
        self.known: set[int] = set()

    def ask(self, request: worker.Request) -> worker.Answer:
        """Send a request and wait for its answer.

        Raises:
            EOFError, OSError: the process has ended.
        """
        into, out = self.popen.stdin, self.popen.stdout
        assert into is not None and out is not None
        send(into, pickle.dumps(request))
        answer: worker.Answer = pickle.loads(worker.receive(out))
        return answer

    def close(self) -> None:
        """End it."""
        self.popen.kill()
        for pipe in (self.popen.stdin, self.popen.stdout):
            with contextlib.suppress(OSError):  # what was not read yet
                assert pipe is not None
                pipe.close()
        self.popen.wait()


def send(into: IO[bytes], content: bytes) -> None:
    """Write what `elsewhere_worker.receive` reads."""
    into.write(struct.pack("<Q", len(content)) + content)
    into.flush()


class Workers:
    """Processes that run sessions: started when they are needed, ended with this object.

    Args:
        count: how many.
    """

    def __init__(self, count: int) -> None:
        self._free: queue.LifoQueue[_Process | None] = queue.LifoQueue()
        for _ in range(count):
            self._free.put(None)
        self._numbers = itertools.count()
        self._all: list[_Process] = []
        self.close = weakref.finalize(self, _ended, self._all)

    def number(self) -> int:
        """Of a new session."""
        return next(self._numbers)

    def ask(self, number: int, order: bytes, values: Mapping[str, float], limit: float) -> Any:
        """Run a session in the first process that is free.

        Raises:
            FmuCallError: the process ended.
            OSError: none can be started.
        """
        process = self._free.get()
        try:
            if process is None:
                process = _Process()
                self._all.append(process)
        except OSError:
            self._free.put(None)
            raise
        keep = False
        try:
            new = number not in process.known
            request = worker.Request(number, order if new else None, dict(values), limit)
            answer = process.ask(request)
            process.known = set(answer.known)
            keep = True
            return answer
        except (EOFError, OSError) as error:
            code = process.popen.wait()
            raise FmuCallError(f"an FMU {reason(code)}") from error
        finally:
            if not keep:
                process.close()
                self._all.remove(process)
            self._free.put(process if keep else None)


def _ended(processes: list[_Process]) -> None:
    """End processes."""
    for process in processes:
        process.close()
    processes.clear()


@dataclass
class Elsewhere:
    """A session that other processes run.

    Attributes:
        outline: of the run.
        workers: which processes.
        work: that the last run took, see `Session.run`.
    """

    outline: Outline
    workers: Workers
    work: int = 0
    _number: int = field(init=False)

    def __post_init__(self) -> None:
        self._number = self.workers.number()

    @property
    def names(self) -> tuple[str, ...]:
        """What is recorded."""
        return self.outline.observed

    @cached_property
    def _order(self) -> bytes:
        plain = replace(
            self.outline,
            system=replace(self.outline.system, provider=None),
            signals=dict.fromkeys(self.outline.signals, Constant(0.0)),  # they are tabulated
        )
        return pickle.dumps(plain)

    def run(self, values: Mapping[str, float], *, limit: float = math.inf) -> tuple[Vector, Vector]:
        """As of `Session.run`.

        Raises:
            FmuCallError: an FMU failed or ended its process, or the run took more than its limit.
            CosimError: a value that an FMU does not take.
        """
        answer = self.workers.ask(self._number, self._order, values, limit)
        if answer.error is not None:
            raise answer.error
        self.work = answer.work
        return answer.times, answer.rows

    def close(self) -> None:
        """Nothing: processes forget what they have not run for long."""
