"""Where a run stands, in memory that its process shares with the one that waits for it.

Both executors write there which FMU they are about to call, so that it can be named when its call
does not return; recorded rows are there, too, and stay when the process is gone.
"""

from __future__ import annotations

import ctypes as ct
import mmap
import os
import pickle
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from . import kernel
from .plan import Op

Vector = NDArray[np.float64]
INDEX, ROW, INSTANCE, OPERATION, CALLS, THREAD = range(6)
SAID = -1
"""Operation whose name is in `text`."""
TEXT = 512
"""Bytes for the name of an instance and of what it is asked for."""
WHAT: Mapping[int, str] = {
    Op.SET: "taking inputs",
    Op.GET: "giving outputs",
    Op.STEP: "a step",
    Op.SUBSTEP: "a step",
    Op.SET_DERIVATIVES: "taking derivatives of inputs",
}


class Witness:
    """The shared memory of one run.

    Args:
        folder: where it is; the files are made by whoever comes first.
        rows, columns: of the recording.
        files: another program shares the memory, not a fork of this process.
        memory: makes shared arrays of a name, type and shape, in place of both.
    """

    def __init__(
        self,
        folder: Path,
        rows: int,
        columns: int,
        *,
        files: bool = True,
        memory: Callable[[str, Any, tuple[int, ...]], NDArray[Any]] | None = None,
    ) -> None:
        self._folder = folder
        shared = memory or partial(_mapped, folder if files else None)
        self.state = shared("state", np.int64, (THREAD + 1,))
        self._text = shared("text", np.uint8, (TEXT,))
        self._run = shared("run", np.uint8, (kernel.structures.RUN_SIZE,))
        self.rows: Vector = shared("rows", np.float64, (rows, columns))
        self._objects: BinaryIO | None = None

    # -- the process that runs --------------------------------------------------------------------

    def say(self, name: str, what: str) -> None:
        """Note what an instance is about to be asked for."""
        content = f"{name}\n{what}".encode()[: TEXT - 1]
        self._text[: len(content)] = np.frombuffer(content, dtype=np.uint8)
        self._text[len(content)] = 0
        self.state[OPERATION] = SAID
        self.state[CALLS] += 1

    def stand(self, index: int, row: int) -> None:
        """Note the communication step under way, and how many rows there are."""
        self.state[INDEX], self.state[ROW] = index, row

    def enter(self) -> None:
        """Note the thread that goes on with the run."""
        self.state[THREAD] = threading.get_ident()

    def do(self, op: Op, instance: int) -> None:
        """Note which operation an instance is about to do."""
        self.state[INSTANCE], self.state[OPERATION] = instance, op
        self.state[CALLS] += 1

    def compiled(self, run: Any) -> Any:
        """The compiled executor's structure with the same content, in shared memory."""
        found = type(run).from_buffer(self._run.data)
        ct.memmove(ct.addressof(found), ct.addressof(run), ct.sizeof(run))
        return found

    def list_calls(
        self, calls: Sequence[tuple[int, int]], derivatives: Sequence[tuple[int, int]]
    ) -> None:
        """Operation and instance of each call of the compiled executor."""
        (self._folder / "calls").write_bytes(pickle.dumps((calls, derivatives)))

    def keep(self, objects: Mapping[str, Any]) -> None:
        """Add a row of recorded objects."""
        if self._objects is None:
            self._objects = (self._folder / "objects").open("wb", buffering=0)
        self._objects.write(pickle.dumps(dict(objects)))

    # -- the process that waits -------------------------------------------------------------------

    @property
    def index(self) -> int:
        """Communication step under way."""
        return max(int(self.state[INDEX]), kernel.standing(self._run).index)

    @property
    def recorded(self) -> Vector:
        """Rows that were recorded."""
        count = max(int(self.state[ROW]), kernel.standing(self._run).row)
        return self.rows[: min(count, self.rows.shape[0])]

    def recorded_objects(self) -> dict[str, list[Any]]:
        """Objects that were recorded."""
        found: dict[str, list[Any]] = {}
        path = self._folder / "objects"
        if path.exists():
            with path.open("rb") as file:
                while True:
                    try:
                        row = pickle.load(file)
                    except (EOFError, pickle.UnpicklingError):  # the last one may be cut short
                        break
                    for name, item in row.items():
                        found.setdefault(name, []).append(item)
        return found

    def beat(self) -> tuple[int, ...]:
        """Numbers of which one changes with each call."""
        standing = kernel.standing(self._run)
        return int(self.state[CALLS]), standing.index, standing.call, standing.member

    def begun(self) -> bool:
        """Whether an FMU was called."""
        return bool(self.state[CALLS])

    def under_way(self, names: Sequence[str]) -> tuple[str, str]:
        """The instance that is being called, "" before the first one, and what it was asked for."""
        standing = kernel.standing(self._run)
        if standing.member >= 0:
            return names[standing.member], WHAT[Op.STEP]
        if standing.call >= 0 or standing.derivatives >= 0:
            calls, derivatives = pickle.loads((self._folder / "calls").read_bytes())
            op, instance = (
                calls[standing.call] if standing.call >= 0 else derivatives[standing.derivatives]
            )
            return names[instance], WHAT[op]
        if self.state[OPERATION] == SAID:
            text = bytes(self._text).partition(b"\0")[0].decode(errors="replace")
            name, _, what = text.partition("\n")
            return name, what
        if not self.begun():
            return "", ""
        return names[int(self.state[INSTANCE])], WHAT.get(int(self.state[OPERATION]), "a call")


def _mapped(folder: Path | None, name: str, kind: Any, shape: tuple[int, ...]) -> NDArray[Any]:
    """A shared array: in a file of a folder, which is made if it is not there, or for forks."""
    size = int(np.prod(shape)) * np.dtype(kind).itemsize
    if not size:
        return np.zeros(shape, dtype=kind)
    if folder is None:
        return np.frombuffer(mmap.mmap(-1, size), dtype=kind).reshape(shape)
    path = folder / name
    if not path.exists():
        with path.open("wb") as file:
            if hasattr(os, "posix_fallocate"):  # no room is said now, not by a bus error later
                os.posix_fallocate(file.fileno(), 0, size)
            else:
                file.truncate(size)
    return np.memmap(path, dtype=kind, mode="r+", shape=shape)
