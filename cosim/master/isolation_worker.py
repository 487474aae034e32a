"""The other process of an isolated run; see `isolation`."""

from __future__ import annotations

import ctypes as ct
import faulthandler
import os
import pickle
import shutil
import signal
import sys
import threading
import time
import traceback
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..errors import StepError
from ..fmu import calls
from .execution import Execution
from .interpreter import Interpreter
from .kernel.updates import update
from .outline import Outline
from .plan import Op
from .witness import Witness

WATCH = 0.2
"""Time between two looks whether the ordering process is still there [s]."""


@dataclass(frozen=True)
class Order:
    """What the other process shall run, the folder that it shares with this one, and this one."""

    outline: Outline
    folder: Path
    owner: int = field(default_factory=os.getpid)


@dataclass(frozen=True)
class Outcome:
    """What it says at the end.

    Attributes:
        error: what it raised, but for the end of a run by an FMU's error.
        text, messages: of that error.
        bond_energy, how, objects, notes, bond_turnover: of the recording.
        beside: communication point of its last row if it is none of every n-th.
    """

    error: Exception | None = None
    text: str = ""
    messages: tuple[str, ...] = ()
    bond_energy: Mapping[str, float] = field(default_factory=dict)
    how: Mapping[str, Any] = field(default_factory=dict)
    objects: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    bond_turnover: Mapping[str, float] = field(default_factory=dict)
    beside: int | None = None


class Told(Interpreter):
    """An interpreter that says what it is about to do."""

    def __init__(self, outline: Outline, stack: ExitStack, update: int, witness: Witness) -> None:
        self.witness = self.shared = witness
        super().__init__(outline, stack, update)
        if witness.rows.shape == self.rows.shape:
            self.rows = witness.rows

    def do(self, op: Op, a: int, b: int) -> None:
        """See `Interpreter`."""
        self.tell()
        if op in (Op.SET, Op.GET, Op.STEP, Op.SUBSTEP):
            self.shared.do(op, a)
        elif op is Op.SET_DERIVATIVES:
            self.shared.do(op, self.derivatives.calls[a, b][0].instance)
        super().do(op, a, b)

    def tell(self) -> None:
        """Say where the run stands."""
        self.shared.stand(self.index, self.row)

    def record(self) -> None:
        """See `Interpreter`."""
        before = self.row
        super().record()
        if self.passing and self.row > before:
            self.shared.keep({name: items[-1] for name, items in self.passing.kept.items()})


def execute(order: Order, witness: Witness) -> Outcome:
    """Run what was ordered."""
    text, messages = "", tuple[str, ...]()
    try:
        with ExitStack() as stack:
            calls.listen(witness.say)
            told = Told(order.outline, stack, update(order.outline.executor), witness)
            execution = Execution(order.outline, stack, lambda *_: told)
            try:
                recording = execution.execute()
            except StepError as error:
                recording, text, messages = error.recording, str(error), error.messages
            finally:
                told.tell()
    except Exception as error:
        error.__context__ = error.__cause__ = None
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:  # whatever keeps it from going to the other process
            return Outcome(RuntimeError(traceback.format_exc()))
        return Outcome(error)
    how = {key: recording.provenance[key] for key in execution.how()}
    objects = {name: list(items) for name, items in recording.objects.items()}
    return Outcome(
        None, text, messages, recording.bond_energy, how, objects, tuple(recording.notes),
        recording.bond_turnover, told.beside,
    )  # fmt: skip


def orphaned(owner: int, folder: Path) -> None:
    """End this process when the one that ordered it is gone; nobody else would end a hanging FMU.

    An FMU's call holds no interpreter lock, so this thread runs beside it.
    """
    while os.getppid() == owner:
        time.sleep(WATCH)
    shutil.rmtree(folder, ignore_errors=True)
    if hasattr(os, "killpg"):
        os.killpg(0, signal.SIGKILL)
    os._exit(1)


def serve(order: Order, witness: Witness) -> None:
    """Run the order, write the outcome, end the process."""
    faulthandler.disable()  # the ordering process says in a sentence what happened
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the ordering process decides
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=orphaned, args=(order.owner, order.folder), daemon=True).start()
    outcome = execute(order, witness)
    part = order.folder / "outcome.part"
    part.write_bytes(pickle.dumps(outcome))
    part.rename(order.folder / "outcome")
    if sys.platform != "win32":
        ct.CDLL(None).fflush(None)  # what FMUs printed
    os._exit(0)  # what libraries of FMUs do at an ordinary end is of no use here


def main() -> None:
    """Read the order whose path is the program's argument, and serve it."""
    order: Order = pickle.loads(Path(sys.argv[1]).read_bytes())
    outline = order.outline
    serve(order, Witness(order.folder, outline.capacity, len(outline.observed)))
