"""Which FMU each thread of a command calls, for the process that waits for it.

A command that runs FMUs in many sessions and threads does so in a fork of its process. The fork
notes in memory that both share which FMU a session or a thread is about to call. If it ends without
having said so, the waiting process names the FMU of the thread that crashed: Python's fault handler
tells that thread. One that calls exit() is told by a handler at the exit; where nothing tells the
thread (a kill from outside), all FMUs that were being called are named.
"""

from __future__ import annotations

import ctypes as ct
import faulthandler
import mmap
import pickle
import re
import shutil
import threading
import weakref
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..fmu import calls
from . import execution, kernel
from .interpreter import Interpreter
from .isolation import WAY_OUT, reason
from .isolation_worker import Told
from .outline import Outline
from .plan import Op
from .witness import THREAD, WHAT, Witness

HEAD, SLOT = 64, 2048
"""Bytes at the beginning of the memory, and for what one session or thread says."""
SLOTS = 1024
"""Sessions and threads at a time; further ones are not named."""
SIZE = HEAD + SLOTS * SLOT
_DONE, _EXITING = 0, 1
_THREAD = re.compile(r"Current thread 0x([0-9a-f]+)")


class _Slot(Witness):
    """A witness in a part of the memory.

    Args:
        board: whose memory it is.
        number: which part.
    """

    def __init__(self, board: Board, number: int) -> None:
        self.board, self.number = board, number
        self._next = HEAD + number * SLOT
        self.names: list[str] = []
        super().__init__(board.folder / str(number), 0, 0, memory=self._carved)

    def _carved(self, _: str, kind: Any, shape: tuple[int, ...]) -> NDArray[Any]:
        count = int(np.prod(shape))
        if not count:
            return np.zeros(shape, dtype=kind)
        found: NDArray[Any] = np.frombuffer(self.board.memory, kind, count, self._next)
        self._next += -(-found.nbytes // 8) * 8
        return found.reshape(shape)

    def begin(self, members: Mapping[str, str]) -> None:
        """Say of which FMUs a run is: name -> where from."""
        self.names = list(members)
        folder = self.board.folder / str(self.number)
        folder.mkdir(exist_ok=True)
        (folder / "members").write_bytes(pickle.dumps(dict(members)))

    def do(self, op: Op, instance: int) -> None:
        """The thread says it, so that what it said last is what it does."""
        self.board.say(self.names[instance], WHAT.get(op, "a call"))

    def keep(self, objects: Mapping[str, Any]) -> None:
        """Nobody else reads recorded values."""

    def clear(self) -> None:
        """Nobody uses it any longer."""
        self.state[:] = 0
        self._run[:] = 0

    # -- the process that waits -------------------------------------------------------------------

    def members(self) -> dict[str, str]:
        """What `begin` said; empty for a thread."""
        path = self.board.folder / str(self.number) / "members"
        return dict(pickle.loads(path.read_bytes())) if path.exists() else {}

    def compiled_call(self) -> tuple[str, str] | None:
        """The instance that the compiled executor is calling, and what it was asked for."""
        standing = kernel.standing(self._run)
        if max(standing.call, standing.member, standing.derivatives) < 0:
            return None
        return self.under_way(list(self.members()))


class _Mine(threading.local):
    """What a thread keeps while it lives."""

    slot: _Slot | None = None
    holder: _Holder | None = None


class _Holder:
    """Is gone when its thread is."""


class Board:
    """The memory and folder that a command's fork shares with the process that waits.

    Args:
        memory: of `SIZE` bytes, made before the fork.
        folder: that only these two use.
    """

    def __init__(self, memory: mmap.mmap, folder: Path) -> None:
        self.memory, self.folder = memory, folder
        self._head = np.frombuffer(memory, np.int64, HEAD // 8)
        self._free = list(range(SLOTS))[::-1]
        self._lock = threading.Lock()
        self._mine = _Mine()
        self._kept: list[Any] = []

    # -- the fork ----------------------------------------------------------------------------------

    def watch(self) -> None:
        """Note from here on what FMUs are called for."""
        calls.listen(self.say)
        execution.usual(self._interpreter)
        handler = ct.CFUNCTYPE(None, ct.c_void_p)(self._leaving)
        ct.CDLL(None)["__cxa_atexit"](handler, None, None)
        words = (self.folder / "crash").open("w")
        faulthandler.enable(words)
        self._kept += [handler, words]

    def _leaving(self, _: object) -> None:
        self._head[_EXITING] = threading.get_ident()

    def say(self, name: str, what: str) -> None:
        """Note what the present thread is about to ask an instance for."""
        mine = self._mine
        if mine.slot is None:
            mine.holder = _Holder()
            mine.slot = self._slot(mine.holder)
        if mine.slot is not None:
            mine.slot.enter()
            mine.slot.say(name, what)

    def _interpreter(self, outline: Outline, stack: ExitStack, update: int) -> Interpreter:
        holder = _Holder()
        slot = self._slot(holder)
        if slot is None:
            return Interpreter(outline, stack, update)
        slot.begin({name: m.reference for name, m in outline.system.members.items()})
        slot.enter()
        stack.callback(lambda: holder)  # as long as the instances live
        return Told(outline, stack, update, slot)

    def _slot(self, owner: object) -> _Slot | None:
        with self._lock:
            if not self._free:
                return None
            number = self._free.pop()
        slot = _Slot(self, number)
        slot.clear()
        weakref.finalize(owner, self._give_back, slot)
        return slot

    def _give_back(self, slot: _Slot) -> None:
        slot.clear()
        shutil.rmtree(self.folder / str(slot.number), ignore_errors=True)
        with self._lock:
            self._free.append(slot.number)

    # -- the process that waits --------------------------------------------------------------------

    def finished(self) -> bool:
        """Whether the fork came to its own end, and said so in the first byte."""
        return bool(self._head[_DONE])

    def sentence(self, code: int) -> str:
        """What happened, by the code with which the fork ended."""
        return f"{self._blame()} {reason(code)}; {WAY_OUT}"

    def _blame(self) -> str:
        slots = [_Slot(self, number) for number in range(SLOTS)]
        used = [slot for slot in slots if slot.state[THREAD]]
        where = {name: f" ({place})" for slot in used for name, place in slot.members().items()}
        compiled: dict[int, tuple[str, str]] = {}
        said: dict[int, tuple[str, str]] = {}
        for slot in used:
            thread = int(slot.state[THREAD])
            if (call := slot.compiled_call()) is not None:
                compiled[thread] = call
            elif not slot.members():
                said[thread] = slot.under_way([])
        thread = self._thread()
        if thread:
            known = compiled.get(thread) or said.get(thread)
            found = [known] if known else []
        else:
            found = list((compiled or said).values())
        texts = [f"{name}{where.get(name, '')}, in {what}," for name, what in dict.fromkeys(found)]
        return " or ".join(texts) or "its process, before any FMU was called,"

    def _thread(self) -> int:
        """The one that crashed or left, 0 if nothing tells."""
        path = self.folder / "crash"
        match = _THREAD.search(path.read_text(errors="replace")) if path.exists() else None
        return int(match[1], 16) if match else int(self._head[_EXITING])
