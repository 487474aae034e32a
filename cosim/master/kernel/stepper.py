"""Communication steps by the compiled executor, which fail as the interpreter would."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NoReturn

from ...errors import EndRequest, FmuCallError
from ...fmu.instance import Instance
from ..interpreter import Interpreter
from ..plan import Op, decoded
from . import TOO_LARGE, TOO_LONG, UNFIT, UNSETTLED, Kernel


class Compiled:
    """A `plan.Stepper` for plans whose steps are operations alone.

    Raises:
        FileNotFoundError: this machine has no compiled executor; the text is its file name.
    """

    looks_ahead = False

    def __init__(self, run: Interpreter) -> None:
        self.run, self.kernel = run, Kernel(run)

    def advance(self, last: int) -> None:
        """Go on up to a communication point."""
        self._ended(self.kernel.advance(last))

    def advance_within(self, last: int, limit: float, most: float) -> int:
        """The same within limits, and the status that ended it early (see `Kernel`)."""
        return self._ended(self.kernel.advance_within(last, limit, most))

    def restart(self) -> None:
        """Begin anew."""
        self.kernel.restart()

    def save(self) -> bytes:
        """What it keeps from step to step."""
        return self.kernel.save()

    def restore(self, memory: bytes) -> None:
        """Return to it."""
        self.kernel.restore(memory)

    def steps(self) -> int:
        """Steps that were made."""
        return self.run.index

    def report(self) -> Mapping[str, Any]:
        """Nothing to say; instances are told of warnings."""
        self.kernel.note_warnings()
        return {}

    def _ended(self, status: int) -> int:
        """Where the compiled executor is; what has not failed goes through."""
        self.run.index, self.run.row = int(self.kernel.run.index), int(self.kernel.run.row)
        self.run.noted = self.run.index
        if status and status not in (TOO_LONG, TOO_LARGE):
            self._fail(status)
        return status

    def _fail(self, status: int) -> None:
        """Raise what the interpreter would have raised."""
        run = self.run
        if status == UNSETTLED:
            raise run.unsolved(int(self.kernel.run.failed_loop))
        op, instance, part = self.kernel.failed()
        if instance is None:
            run.record()
            return
        if op is Op.STEP:
            instance.time = run.instants[run.index]
            size = run.size(instance.time, run.step)
            self._raise_step(instance, instance.failed_step(size, status, self.kernel.reached()))
        if op is Op.GET or run.index:  # it has stepped: where it is by its own count
            last = run.index if op is Op.GET else run.index - 1
            instance.time = run.instants[last] + run.step
        if op is Op.SET_DERIVATIVES:
            raise instance.failed_derivatives(part, status)
        if status == UNFIT:
            raise run.inputs[run.instances.index(instance)].unfit(part)
        raise instance.failed_access(op is Op.GET, part, status)

    def _raise_step(self, instance: Instance, error: FmuCallError) -> NoReturn:
        """Raise; if an FMU asked to end, the interpreter first brings the others to its time."""
        run = self.run
        steps, row = decoded(run.plan.step), (Op.STEP, run.instances.index(instance), 0)
        ended = isinstance(error, EndRequest) and run.completes(error)
        if isinstance(error, EndRequest) and ended and row in steps:  # not in parts of a step
            self.kernel.hand_over()
            try:
                run.communication_step(steps, steps.index(row) + 1)
            except EndRequest as other:  # of another one, too
                if not other.complete:
                    raise
            error.complete = True
        raise error
