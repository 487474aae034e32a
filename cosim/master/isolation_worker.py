"""The other process of an isolated run; see `isolation`."""

from __future__ import annotations

import os
import pickle
import sys
import threading
import time
from contextlib import ExitStack
from pathlib import Path

from ..data.recording import Recording
from ..errors import AlgebraicLoopError, FmuCallError, StepError
from .execution import Execution
from .interpreter import Interpreter, Vector
from .isolation import (
    BESIDE,
    CALLS,
    INDEX,
    INSTANCE,
    NOTHING,
    OBJECTS,
    OPERATION,
    ROW,
    Order,
    Outcome,
    shared,
)
from .outline import Outline
from .plan import Op

HOW = ("fmu_steps", "step_control")
"""Entries of a provenance that only the executing process knows."""
WATCH = 0.2
"""Time between two looks whether the ordering process is still there [s]."""


class _Told(Interpreter):
    """An interpreter that says what it is about to do."""

    def __init__(self, outline: Outline, stack: ExitStack, folder: Path) -> None:
        super().__init__(outline, stack)
        self.state, self.rows = shared(folder, *self.rows.shape)
        self._written = stack.enter_context((folder / OBJECTS).open("wb"))

    def do(self, op: Op, a: int, b: int) -> None:
        self.tell()
        if op in (Op.SET, Op.GET, Op.STEP, Op.SUBSTEP):
            self.state[INSTANCE], self.state[OPERATION] = a, op
        self.state[CALLS] += 1
        super().do(op, a, b)

    def keep(self, row: Vector) -> None:
        super().keep(row)
        if self.passing.kept:
            pickle.dump({n: items[-1] for n, items in self.passing.kept.items()}, self._written)
            self._written.flush()

    def tell(self) -> None:
        """Say where the run stands."""
        self.state[INDEX], self.state[ROW] = self.index, self.row
        self.state[BESIDE] = NOTHING if self.beside is None else self.beside


def execute(order: Order) -> Outcome:
    """Run what was ordered."""
    with ExitStack() as stack:
        try:
            told = _Told(order.outline, stack, order.folder)
            execution = Execution(order.outline, stack, lambda *_: told)
            try:
                recording = execution.execute()
            finally:
                told.tell()
        except StepError as error:
            return _outcome("step", error.recording, str(error), error.messages)
        except FmuCallError as error:
            return Outcome("call", str(error), error.messages)
        except AlgebraicLoopError as error:
            return Outcome("loop", str(error))
    return _outcome("ok", recording)


def _outcome(
    kind: str, recording: Recording | None, text: str = "", messages: tuple[str, ...] = ()
) -> Outcome:
    """What is said of a recording; its values are in the shared files."""
    if recording is None:
        return Outcome(kind, text, messages)
    how = {key: item for key, item in recording.provenance.items() if key in HOW}
    return Outcome(
        kind, text, messages, recording.bond_energy, how, recording.bond_turnover, recording.notes
    )


def orphaned() -> None:
    """End this process when the one that ordered it is gone; nobody else would end a hanging FMU.

    An FMU's call holds no interpreter lock, so this thread runs beside it.
    """
    parent = os.getppid()
    while os.getppid() == parent:
        time.sleep(WATCH)
    os._exit(1)


def main(path: Path) -> None:
    """Read the order, run it, write the outcome."""
    threading.Thread(target=orphaned, daemon=True).start()
    order: Order = pickle.loads(path.read_bytes())
    outcome = execute(order)
    part = order.folder / "outcome.part"
    part.write_bytes(pickle.dumps(outcome))
    part.rename(order.folder / "outcome")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
