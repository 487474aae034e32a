"""Steps that are repeated: all FMUs, and the values between them, return to a saved state."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..fmu.exchange import Objects
from ..fmu.instance import State
from .interpreter import Interpreter


@dataclass(frozen=True)
class Checkpoint:
    """Where a run can return to.

    Attributes:
        states: of the instances.
        values, objects: what was exchanged.
    """

    states: list[State]
    values: NDArray[np.float64]
    objects: Objects


@contextmanager
def saved(run: Interpreter) -> Iterator[Checkpoint]:
    """The present state, released at the end; until then steps can be taken back."""
    states: list[State] = []
    try:
        for instance in run.instances:
            states.append(instance.save())
            instance.returning(True)
        yield Checkpoint(states, run.values.copy(), run.objects.copy())
    finally:
        for instance, state in zip(run.instances, states, strict=False):
            instance.returning(False)
            instance.release(state)


def restore(run: Interpreter, checkpoint: Checkpoint) -> None:
    """Return to a saved state."""
    for instance, state in zip(run.instances, checkpoint.states, strict=True):
        instance.restore(state)
    run.values[:] = checkpoint.values
    run.objects[:] = checkpoint.objects
