"""The other process of an isolated run; see `isolation`."""

from __future__ import annotations

import os
import pickle
import sys
import threading
import time
from contextlib import ExitStack
from pathlib import Path

from ..data.signals import Constant
from ..errors import AlgebraicLoopError, FmuCallError, StepError
from .execution import Execution
from .isolation import CALLS, INDEX, INSTANCE, OPERATION, ROW, Order, Outcome, shared
from .plan import Op

WATCH = 0.2
"""Time between two looks whether the ordering process is still there [s]."""


class _Told(Execution):
    """A run that says what it is about to do."""

    def watch(self, order: Order) -> None:
        rows = (order.times.size - 1) // order.every + 1
        self.state, self.rows = shared(order.folder, rows, len(order.observed))

    def do(self, op: Op, a: int, b: int) -> None:
        self.state[INDEX], self.state[ROW] = self.index, self.row
        if op in (Op.SET, Op.GET, Op.STEP, Op.SUBSTEP):
            self.state[INSTANCE], self.state[OPERATION] = a, op
        self.state[CALLS] += 1
        super().do(op, a, b)


def execute(order: Order) -> Outcome:
    """Run what was ordered."""
    master = order.master
    plan = master.compile(order.external_names, order.observed)
    signals = {name: Constant(0.0) for name in order.external_names}
    with ExitStack() as stack:
        try:
            run = _Told(
                master, plan, order.observed, order.external, order.times, order.every, signals,
                stack,
            )  # fmt: skip
            run.watch(order)
            recording = run.execute(order.times.size - 1, None)
            run.state[INDEX], run.state[ROW] = run.index, run.row
        except StepError as error:
            run.state[INDEX], run.state[ROW] = run.index, run.row
            return Outcome("step", str(error), error.messages)
        except FmuCallError as error:
            return Outcome("call", str(error), error.messages)
        except AlgebraicLoopError as error:
            return Outcome("loop", str(error))
    return Outcome("ok", bond_energy=recording.bond_energy, steps=run.steps())


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
