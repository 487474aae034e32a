"""What a run keeps between communication steps, as a copy that it can return to."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FmuCallError
from ..fmu.instance import State
from .interpreter import Interpreter

Vector = NDArray[np.float64]
ARRAYS = ("values", "objects", "bond_energy", "bond_turnover", "history", "past", "held")
"""Of a run, besides those of its Newton iterations and of the derivatives of inputs."""


def _arrays(run: Interpreter) -> list[NDArray[Any]]:
    """All arrays that a step changes."""
    derivatives = run.derivatives
    newtons = [array for newton in run.newtons for array in (newton.inverse, newton.valid)]
    return [
        *(getattr(run, name) for name in ARRAYS),
        derivatives.average, derivatives.slope, derivatives.curve, *newtons,
    ]  # fmt: skip


@dataclass
class Memory:
    """A point of a run.

    Attributes:
        states: of the instances.
        arrays: see `_arrays`.
        previous: outputs noted for the energy of bonds.
        index, row: communication point within the window, and rows recorded in it.
        kept: how many recorded objects there are.
        base: communication point at which the window begins.
        blocks: windows before it.
        given: column of the driven inputs -> value that was set.
        stepper: what the stepper keeps.
        rows: recorded in the window, once others are written over them.
        earlier: windows before, likewise.
    """

    states: list[State]
    arrays: list[NDArray[Any]]
    previous: list[float]
    index: int
    row: int
    kept: dict[str, list[Any]]
    base: int
    given: dict[int, Any]
    stepper: Any
    blocks: int = 0
    rows: Vector | None = None
    earlier: list[tuple[Vector, Vector]] | None = field(default=None)

    @classmethod
    def of(cls, run: Interpreter, stepper: Any, base: int, given: Mapping[int, Any]) -> Memory:
        """The present point.

        Raises:
            FmuCallError: an FMU cannot save its state.
        """
        states: list[State] = []
        try:
            for instance in run.instances:
                states.append(instance.save())
        except FmuCallError as error:
            for instance, state in zip(run.instances, states, strict=False):
                instance.release(state)
            raise FmuCallError(f"{error}; run the scenario anew instead", error.messages) from None
        return cls(
            states, [array.copy() for array in _arrays(run)], list(run.previous), run.index,
            run.row, {name: list(items) for name, items in run.passing.kept.items()}, base,
            dict(given), stepper,
        )  # fmt: skip

    def put(self, run: Interpreter, states: Sequence[State] | None = None) -> None:
        """Return to it; `states` instead of those of its own run."""
        for instance, state in zip(run.instances, states or self.states, strict=True):
            instance.restore(state)
        for array, content in zip(_arrays(run), self.arrays, strict=True):
            array[:] = content
        run.previous = list(self.previous)
        run.index, run.row, run.beside = self.index, self.row, None
        for name, items in self.kept.items():
            run.passing.kept[name][:] = items
        for instance in run.instances:
            instance.time = float(run.times[run.index])

    def serialized(self, run: Interpreter) -> list[bytes]:
        """The states of the instances as bytes.

        Raises:
            FmuCallError: an FMU cannot hand its state on.
        """
        return [
            instance.serialize(state)
            for instance, state in zip(run.instances, self.states, strict=True)
        ]

    def release(self, run: Interpreter) -> None:
        """Free the states."""
        for instance, state in zip(run.instances, self.states, strict=True):
            instance.release(state)

    # -- rows ------------------------------------------------------------------------------------

    def keep_rows(
        self, run: Interpreter, blocks: list[tuple[Vector, Vector]], base: int, to: Memory
    ) -> None:
        """Copy the recorded rows that the run writes over when it goes on from `to`.

        Those of points before `to` stay where they are, so going back and forth between a point and
        what lies behind it copies nothing.
        """
        shared = to.rows is None and (self.base, self.row) <= (to.base, to.row)
        if self is to or self.rows is not None or shared:
            return
        inside = self.base == base
        self.rows = (run.rows if inside else blocks[self.blocks][1])[: self.row].copy()
        self.earlier = blocks[: self.blocks]

    def recorded(
        self, run: Interpreter, blocks: list[tuple[Vector, Vector]]
    ) -> list[tuple[Vector, Vector]]:
        """Bring back the rows recorded in the window; the windows before."""
        if self.rows is not None:
            run.rows[: self.row] = self.rows
        elif self.blocks < len(blocks):
            run.rows[: self.row] = blocks[self.blocks][1][: self.row]
        return blocks[: self.blocks] if self.earlier is None else list(self.earlier)

    @staticmethod
    @contextmanager
    def exchange(run: Interpreter) -> Iterator[None]:
        """Values may be exchanged without a trace; FMUs keep the inputs that they were given."""
        arrays, before = _arrays(run), [array.copy() for array in _arrays(run)]
        previous = list(run.previous)
        try:
            yield
        finally:
            for array, content in zip(arrays, before, strict=True):
                array[:] = content
            run.previous = previous


@dataclass(eq=False)
class Saved:
    """Where a twin can return to, while it is open.

    Attributes:
        time: [s].
    """

    time: float
    memory: Memory
