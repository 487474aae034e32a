"""Sequences of operations for algorithms that repeat steps or choose their size.

The algorithm decides in Python; what it decides on, all calls of the FMUs between two decisions, is
done by the compiled executor where there is one.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from ...errors import FmuCallError
from .. import rollback
from ..interpreter import Interpreter
from ..plan import Op, decoded
from ..rollback import Checkpoint
from . import FORGET, RESTORE, SAVE, UNFIT, UNSETTLED, Kernel, find


def compiles(run: Interpreter) -> bool:
    """Whether a run's operations can be done by the compiled executor, and shall be."""
    return (
        type(run) is Interpreter  # others do something before each operation
        and run.outline.executor != "python"
        and not run.layout.objects.any()
        and find() is not None
    )


class Programs:
    """Sequences of operations, by whichever executor the run has.

    Args:
        run: what they work on.
        sequences: rows of operations; `do` takes their number.
    """

    def __init__(self, run: Interpreter, *sequences: NDArray[np.int64]) -> None:
        self._run = run
        self._sequences = [decoded(rows) for rows in sequences]
        self.kernel = Kernel(run, sequences) if compiles(run) else None

    def do(self, number: int, time: float, size: float = 0.0) -> None:
        """All operations of a sequence; steps begin at `time` and are as long as `size` [s].

        Raises:
            AlgebraicLoopError: a loop does not settle.
            EndRequest: an FMU asked to end the simulation.
            FmuCallError: an FMU refused.
        """
        run = self._run
        if self.kernel is None:
            for op, a, b in self._sequences[number]:
                if op is Op.STEP:
                    run.instances[a].step(time, size)
                else:
                    run.do(op, a, b)
            return
        status = self.kernel.do(number, time, size)
        if status:
            raise self._failure(self.kernel, status, time, size)

    @contextmanager
    def saved(self) -> Iterator[Checkpoint]:
        """The present state, until the end of the block, within which steps can be taken back."""
        if self.kernel is None:
            with rollback.saved(self._run) as checkpoint:
                yield checkpoint
            return
        try:
            self._states(SAVE)
            yield Checkpoint([], self._run.values.copy(), self._run.objects)
        finally:
            self._states(FORGET)

    def restore(self, checkpoint: Checkpoint) -> None:
        """Return to what `saved` gave."""
        if self.kernel is None:
            rollback.restore(self._run, checkpoint)
            return
        self._states(RESTORE)
        self._run.values[:] = checkpoint.values

    def _states(self, what: int) -> None:
        assert self.kernel is not None
        if what == FORGET and any(instance.dead for instance in self._run.instances):
            return  # the error of the step is the one to tell
        status = self.kernel.states(what)
        if status:
            instance = self._run.instances[int(self.kernel.run.failed_member)]
            verb = ("saving the", "restoring a", "releasing a")[what]
            raise instance.failure(f"{verb} state", status)

    def report(self) -> None:
        """Tell the instances of warnings."""
        if self.kernel is not None:
            self.kernel.note_warnings()

    def _failure(
        self, kernel: Kernel, status: int, time: float, size: float
    ) -> FmuCallError | Exception:
        """What the interpreter would have raised."""
        run = self._run
        if status == UNSETTLED:
            return run.unsolved(int(kernel.run.failed_loop))
        op, instance, part = kernel.failed()
        if instance is None:
            raise AssertionError(f"status {status} of a program that records nothing")
        instance.time = time + size if op is Op.GET else time
        if op is Op.STEP:
            return instance.failed_step(size, status, kernel.reached())
        if op is Op.SET_DERIVATIVES:
            return instance.failed_derivatives(part, status)
        if status == UNFIT:
            return run.inputs[run.instances.index(instance)].unfit(part)
        return instance.failed_access(op is Op.GET, part, status)
