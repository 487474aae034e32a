"""Steps that are repeated: all FMUs return to saved states, and step again with other inputs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import FmuCallError
from ..fmu.instance import State
from .algebraic_loops import Newton
from .plan import Iteration, Op

if TYPE_CHECKING:
    from .execution import Execution

Vector = NDArray[np.float64]
FIXED_POINT = 12
"""Repetitions before Newton's method takes over."""


@contextmanager
def saved(run: Execution) -> Iterator[list[State]]:
    """The states of all instances, released at the end."""
    states: list[State] = []
    try:
        for instance in run.instances:
            states.append(instance.save())
        yield states
    finally:
        for instance, state in zip(run.instances, states, strict=False):
            instance.release(state)


def restore(run: Execution, states: list[State]) -> None:
    """Return all instances to their saved states."""
    for instance, state in zip(run.instances, states, strict=True):
        instance.restore(state)


class Iterated:
    """Communication steps whose inputs are the means of begin and end values.

    Attributes:
        repetitions: steps of the whole system that were made, for the record.
    """

    def __init__(self, run: Execution, settings: Iteration) -> None:
        self.run, self.settings = run, settings
        layout = run.layout
        self.sources = np.unique(layout.copy_source[settings.smooth])
        self.newton = Newton(self.sources.size, settings.tolerance)
        self.sweep = [(Op(int(op)), int(a), int(b)) for op, a, b in run.plan.solving]
        self.held = np.zeros(0)
        self.repetitions = 0

    def restart(self) -> None:
        """Forget what earlier steps were like."""
        self.newton.valid[0] = 0

    def step(self) -> None:
        """One communication step."""
        run = self.run
        begin = run.values.copy()
        with saved(run) as states:
            end = begin[self.sources].tolist()
            settled = not self.newton.valid[0] and self.fixed_point(states, begin, end)
            if not settled:
                end = begin[self.sources].tolist()
                settled = self.newton.solve(lambda z: self.attempt(states, begin, z), end)
            if not settled:
                raise FmuCallError(
                    f"{run.master.system.name}: the step of {run.master.step:.9g} s does not "
                    "settle, neither by repetition nor by Newton's method; take a smaller "
                    "communication step"
                )
        run.account(self.held[run.layout.bond_input - self.input_slots.start])

    @property
    def input_slots(self) -> slice:
        """Where inputs stand among the values."""
        inputs = self.run.layout.inputs
        return slice(int(inputs[0, 0]), int(inputs[-1, 1]))

    def fixed_point(self, states: list[State], begin: Vector, end: list[float]) -> bool:
        """Repeat the step with the end values of the last repetition; whether that settled."""
        last = np.inf
        for _ in range(FIXED_POINT):
            found = self.attempt(states, begin, end)
            size = max(
                (abs(a - b) / max(1.0, abs(b)) for a, b in zip(found, end, strict=True)),
                default=0.0,
            )
            end[:] = found
            if size <= self.settings.tolerance:
                return True
            if not size < last:
                return False
            last = size
        return False

    def attempt(self, states: list[State], begin: Vector, end: list[float]) -> list[float]:
        """End values of a step with inputs from given end values."""
        run, layout = self.run, self.run.layout
        restore(run, states)
        self.repetitions += 1
        values = run.values
        values[:] = begin
        values[self.sources] = 0.5 * (begin[self.sources] + np.array(end))
        values[layout.copy_target] = (
            values[layout.copy_source] * layout.copy_gain + layout.copy_offset
        )
        self.held = values[self.input_slots].copy()
        for op in (Op.SET, Op.STEP, Op.GET):
            for index in range(len(run.instances)):
                run.do(op, index, 0)
        for op, a, b in self.sweep:
            run.do(op, a, b)
        found: list[float] = values[self.sources].tolist()
        return found
