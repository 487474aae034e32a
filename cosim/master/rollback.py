"""Steps that are repeated: all FMUs return to saved states."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ..fmu.instance import State
from .interpreter import Interpreter


@contextmanager
def saved(run: Interpreter) -> Iterator[list[State]]:
    """The states of all instances, released at the end."""
    states: list[State] = []
    try:
        for instance in run.instances:
            states.append(instance.save())
        yield states
    finally:
        for instance, state in zip(run.instances, states, strict=False):
            instance.release(state)


def restore(run: Interpreter, states: list[State]) -> None:
    """Return all instances to their saved states."""
    for instance, state in zip(run.instances, states, strict=True):
        instance.restore(state)
