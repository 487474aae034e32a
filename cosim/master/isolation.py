"""Runs in a process of their own: what an FMU does there cannot take this process with it.

The other process (`isolation_worker`) gets the system and the table of external inputs,
executes the plan in Python, and says before each call to an FMU which one it is. Recorded rows are
in a shared file, so that they are there whatever happens. This process waits; it ends the other one
if no call returns within the time limit.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data.recording import Recording
from ..data.signals import Constant
from ..errors import AlgebraicLoopError, FmuCallError, StepError
from ..system.system import System
from .outline import Outline
from .plan import Op

Vector = NDArray[np.float64]
INDEX, ROW, INSTANCE, OPERATION, CALLS, BESIDE = range(6)
WHAT = {Op.SET: "taking inputs", Op.GET: "giving outputs", Op.STEP: "a step", Op.SUBSTEP: "a step"}
STARTING = 30.0
"""Longer than the limit, for Python to start and load the FMUs [s]."""
LOADING = -1
"""Operation while FMUs are loaded and initialized."""
NOTHING = -1
"""In place of a communication point that there is not."""
OBJECTS = "objects"
"""File of recorded objects: one pickle per row, a value by name."""


@dataclass(frozen=True)
class Order:
    """What the other process shall run, and the folder that it shares with this one."""

    outline: Outline
    folder: Path


@dataclass(frozen=True)
class Outcome:
    """What it says at the end.

    Attributes:
        kind: ok, step (stopped), call (an FMU refused before the first step), or loop.
        text, messages: of the error.
        bond_energy, notes: of the recording.
        how: what its provenance says of how it was run.
    """

    kind: str
    text: str = ""
    messages: tuple[str, ...] = ()
    bond_energy: Mapping[str, float] = field(default_factory=dict)
    how: Mapping[str, Any] = field(default_factory=dict)
    bond_turnover: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def shared(folder: Path, rows: int, columns: int) -> tuple[NDArray[np.int64], Vector]:
    """State and rows in files of the folder, made by whoever comes first."""
    found: list[Any] = []
    for name, dtype, shape in (
        ("state", np.int64, (BESIDE + 1,)),
        ("rows", np.float64, (rows, columns)),
    ):
        path = folder / name
        size = int(np.prod(shape)) * 8
        if not size:
            found.append(np.zeros(shape, dtype=dtype))
            continue
        if not path.exists():
            path.write_bytes(bytes(size))
        found.append(np.memmap(path, dtype=dtype, mode="r+", shape=shape))
    return found[0], found[1]


def read_objects(folder: Path) -> dict[str, list[Any]]:
    """Recorded objects by name; a row that was not written to its end does not count."""
    found: dict[str, list[Any]] = {}
    path = folder / OBJECTS
    if path.exists():
        with path.open("rb") as file:
            while True:
                try:
                    row: dict[str, Any] = pickle.load(file)
                except (EOFError, pickle.UnpicklingError):
                    break
                for name, item in row.items():
                    found.setdefault(name, []).append(item)
    return found


def run_isolated(
    outline: Outline, limit: float, progress: Callable[[float], None] | None = None
) -> Recording:
    """Run in another process.

    Args:
        outline: of the run.
        limit: longest time that one call to an FMU may take [s].
        progress: told now and then which fraction is done.

    Raises:
        StepError: an FMU failed, crashed or did not return; carries the recording up to then.
        AlgebraicLoopError: initial values do not settle.
    """
    count, system = outline.count, outline.system
    with tempfile.TemporaryDirectory(prefix="cosim-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        state, rows = shared(folder, outline.capacity, len(outline.observed))
        state[OPERATION], state[BESIDE] = LOADING, NOTHING
        plain = replace(
            outline,
            system=replace(system, provider=None),
            signals=dict.fromkeys(outline.signals, Constant(0.0)),  # they are tabulated
            executor="python",
        )
        order = Order(plain, folder)
        (folder / "order").write_bytes(pickle.dumps(order))
        with open(folder / "errors", "wb") as errors:
            process = subprocess.Popen(
                [sys.executable, "-m", "cosim.master.isolation_worker", str(folder / "order")],
                stdin=subprocess.DEVNULL, stdout=errors, stderr=errors, env=_environment(),
            )  # fmt: skip
            try:
                hung = _wait(process, state, limit, count, progress)
            finally:
                if process.poll() is None:
                    process.kill()
                process.wait()
        last = min(int(state[INDEX]), count)

        def recording(error: str, outcome: Outcome | None = None) -> Recording:
            kept = read_objects(folder)
            count = min(int(state[ROW]), rows.shape[0], *map(len, kept.values()))
            beside = int(state[BESIDE])
            return outline.recording(
                np.array(rows[:count]),
                outcome.bond_energy if outcome else {},
                {
                    "isolated": True,
                    "fmu_steps": last * len(system.members),
                    **(outcome.how if outcome else {}),
                },
                error,
                turnover=outcome.bond_turnover if outcome else {},
                objects=kept,
                notes=outcome.notes if outcome else (),
                beside=None if beside == NOTHING else beside,
            )

        path = folder / "outcome"
        outcome: Outcome | None = pickle.loads(path.read_bytes()) if path.exists() else None
        if outcome is not None and outcome.kind == "ok":
            return recording("", outcome)
        when = float(outline.times[last])
        if outcome is not None and outcome.kind == "loop":
            raise AlgebraicLoopError(outcome.text)
        if outcome is not None and outcome.kind == "call":
            raise FmuCallError(outcome.text, outcome.messages)
        if outcome is not None:
            text = outcome.text
            raise StepError(text, outcome.messages, time=when, recording=recording(text, outcome))
        said = (folder / "errors").read_bytes()[-2000:].decode(errors="replace").strip()
        messages = tuple(said.splitlines()[-5:])
        text = f"run stopped at t = {when:.9g} s: {_blame(system, state)} "
        text += (
            f"did not return within {limit:g} s and was ended"
            if hung
            else f"crashed ({_reason(process.returncode)})"
        )
        raise StepError(text, messages, time=when, recording=recording(text))


def _environment() -> dict[str, str]:
    """That of this process, with this package in reach."""
    home = str(Path(__file__).resolve().parents[2])
    paths = [home, *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


def _wait(
    process: subprocess.Popen[bytes],
    state: NDArray[np.int64],
    limit: float,
    count: int,
    progress: Callable[[float], None] | None,
) -> bool:
    """Wait for the end; whether nothing happened for too long."""
    seen, since = -1, time.monotonic()
    while True:
        try:
            process.wait(0.05)
            return False
        except subprocess.TimeoutExpired:
            if progress is not None:
                progress(int(state[INDEX]) / count)  # in a hang, too: it may end the run
            calls = int(state[CALLS])
            if calls != seen:
                seen, since = calls, time.monotonic()
            elif time.monotonic() - since > limit + (0 if calls else STARTING):
                return True


def _blame(system: System, state: NDArray[np.int64]) -> str:
    members = list(system.members.values())
    member = members[min(max(int(state[INSTANCE]), 0), len(members) - 1)]
    operation = int(state[OPERATION])
    what = "being created" if operation == LOADING else WHAT.get(Op(operation), "a call")
    return f"{member.name} ({member.reference}), in {what},"


def _reason(code: int) -> str:
    if code >= 0:
        return f"its process ended with code {code}"
    try:
        return f"signal {signal.Signals(-code).name}"
    except ValueError:
        return f"signal {-code}"
