"""Runs in a process of their own: what an FMU does there cannot take this process with it.

The other process (`isolation_worker`) executes the plan, and leaves in shared memory (`witness`)
what it records and which FMU it is about to call. This process waits; it names the FMU whose call
ended the other one, and ends it if no call returns within a time limit.

There are two ways to get it. A fork shares everything with this process and costs milliseconds,
but is safe only where no other thread holds a lock, so the command line uses it. A new interpreter
takes half a second.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import select
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..data.recording import Recording
from ..data.signals import Constant
from ..errors import InputError, StepError
from . import isolation_worker as worker
from .isolation_worker import Order, Outcome
from .outline import Outline
from .witness import Witness

STARTING = 30.0
"""Longer than the limit, for Python to start [s]."""
LOOK = 0.05
"""Time between two looks at the progress [s]."""
PROGRAM = f"from {worker.__name__} import main; main()"
WAY_OUT = "take other values or another FMU, or show its supplier this sentence"


def can_fork() -> bool:
    """Whether a fork is safe here: the frameworks of macOS do not bear it, Windows has none."""
    return sys.platform == "linux"


@dataclass
class _Child:
    """The other process, leader of a group that holds whatever FMUs start."""

    pid: int
    popen: subprocess.Popen[bytes] | None = None

    def ended(self, timeout: float) -> bool:
        """Whether it has ended, after waiting for that [s]."""
        if sys.platform == "win32":
            assert self.popen is not None
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.popen.wait(timeout)
            return self.popen.poll() is not None
        try:
            handle = os.pidfd_open(self.pid)
        except (AttributeError, OSError):  # not Linux, or an old one
            if not self._gone():
                time.sleep(timeout)
            return self._gone()
        try:
            return bool(select.select([handle], [], [], timeout)[0])
        finally:
            os.close(handle)

    def _gone(self) -> bool:
        return os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None

    def finish(self) -> int:
        """End it if it has not, with what FMUs have started; its code, negative for a signal."""
        if sys.platform == "win32":
            assert self.popen is not None
            self.popen.kill()
            return self.popen.wait()
        # its number is not given to another process before it has been waited for
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, signal.SIGKILL)
        with contextlib.suppress(ProcessLookupError):  # a fork that has not got its group yet
            os.kill(self.pid, signal.SIGKILL)
        if self.popen is not None:
            return self.popen.wait()
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])


def run_isolated(
    outline: Outline,
    limit: float,
    progress: Callable[[float], None] | None = None,
    *,
    fork: bool = False,
) -> Recording:
    """Run in another process.

    Args:
        outline: of the run.
        limit: longest time that one call to an FMU may take [s].
        progress: told now and then which fraction is done.
        fork: take a fork of this process.

    Raises:
        StepError: an FMU failed, crashed or did not return; carries the recording up to then.
        AlgebraicLoopError: initial values do not settle.
    """
    count, system = outline.count, outline.system
    with tempfile.TemporaryDirectory(prefix="cosim-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        try:
            witness = Witness(folder, outline.capacity, len(outline.observed), files=not fork)
        except OSError as error:
            raise InputError(
                f"{folder.parent}: has no room for the recording of an isolated run "
                f"({error.strerror}); set TMPDIR to another folder"
            ) from error
        child = _forked(Order(outline, folder), witness) if fork else _started(outline, folder)
        hung, code = False, 0
        try:
            hung = _wait(child, witness, limit, count, progress)
        finally:
            code = child.finish()
        path = folder / "outcome"
        outcome: Outcome | None = pickle.loads(path.read_bytes()) if path.exists() else None
        index = min(witness.index, count)
        when = float(outline.times[index])
        isolated = {} if fork else {"isolated": True}

        def recording(error: str, found: Outcome) -> Recording:
            return outline.recording(
                witness.recorded,
                found.bond_energy,
                {"fmu_steps": index * len(system.members), **found.how, **isolated},
                error,
                objects=found.objects or witness.recorded_objects(),
                notes=found.notes,
                turnover=found.bond_turnover,
                beside=found.beside,
            )

        if outcome is not None and outcome.error is not None:
            raise outcome.error
        if outcome is not None and outcome.text:
            text, messages = outcome.text, outcome.messages
            raise StepError(text, messages, time=when, recording=recording(text, outcome))
        if outcome is not None and code == 0:
            return recording("", outcome)
        messages = () if fork else _last_words(folder / "errors")
        text = f"run stopped at t = {when:.9g} s: {_blame(outline, witness)} "
        text += f"did not return within {limit:g} s and was ended" if hung else reason(code)
        text += f"; {WAY_OUT}"
        raise StepError(text, messages, time=when, recording=recording(text, Outcome()))


def _forked(order: Order, witness: Witness) -> _Child:
    """A fork of this process that runs the order."""
    sys.stdout.flush()
    sys.stderr.flush()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # threads: see the module's text
        pid = os.fork()
    if pid:
        return _Child(pid)
    try:
        os.setsid()
        worker.serve(order, witness)
    finally:
        os._exit(1)


def _started(outline: Outline, folder: Path) -> _Child:
    """A new interpreter that runs the order."""
    plain = replace(
        outline,
        system=replace(outline.system, provider=None),
        signals=dict.fromkeys(outline.signals, Constant(0.0)),  # they are tabulated
    )
    (folder / "order").write_bytes(pickle.dumps(Order(plain, folder)))
    with open(folder / "errors", "wb") as errors:
        popen = subprocess.Popen(
            [sys.executable, "-c", PROGRAM, str(folder / "order")],
            stdin=subprocess.DEVNULL, stdout=errors, stderr=errors, env=_environment(),
            start_new_session=True,
        )  # fmt: skip
    return _Child(popen.pid, popen)


def _environment() -> dict[str, str]:
    """That of this process, with this package in reach."""
    home = str(Path(__file__).resolve().parents[2])
    paths = [home, *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


def _wait(
    child: _Child,
    witness: Witness,
    limit: float,
    count: int,
    progress: Callable[[float], None] | None,
) -> bool:
    """Wait for the end; whether nothing happened for too long."""
    seen: Any = None
    since = time.monotonic()
    while not child.ended(LOOK):
        if progress is not None:
            progress(min(witness.index / count, 1.0))  # in a hang, too: it may end the run
        beat = witness.beat()
        if beat != seen:
            seen, since = beat, time.monotonic()
        elif time.monotonic() - since > limit + (0 if witness.begun() else STARTING):
            return True
    return False


def _last_words(path: Path) -> tuple[str, ...]:
    """The end of what the process and its FMUs wrote."""
    said = path.read_bytes()[-2000:].decode(errors="replace").strip()
    return tuple(said.splitlines()[-5:])


def _blame(outline: Outline, witness: Witness) -> str:
    members = outline.system.members
    name, what = witness.under_way(list(members))
    if name not in members:
        return "its process, before any FMU was called,"
    return f"{name} ({members[name].reference}), in {what},"


def reason(code: int) -> str:
    """How a process ended, by its exit code (negative for a signal)."""
    if code >= 0:
        return f"ended the process with exit code {code}, which an FMU must not"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = str(-code)
    memory = ", as systems do when memory runs out" if name == "SIGKILL" else ""
    return f"crashed (signal {name}{memory})"
