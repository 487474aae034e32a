"""The driven inputs of a run in steps: what was set takes the place of what was known before."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data.signals import is_signal
from .interpreter import Interpreter
from .master import Master

Vector = NDArray[np.float64]


class DrivenInputs:
    """The table of a run's driven inputs, part of which is overruled.

    Args:
        master: tabulates signals.
        run: whose table it is.

    Attributes:
        given: column -> value or signal that overrules it.
    """

    def __init__(self, master: Master, run: Interpreter) -> None:
        self._master, self._run = master, run
        self._names = tuple(run.outline.signals)
        self._first = run.external[:2].copy()
        self._before: dict[int, Vector] = {}
        self._held: tuple[NDArray[np.intp], Vector] | None = None
        self._objects = run.outline.objects
        self._items: dict[int, list[Any]] = {}
        self.given: dict[int, Any] = {}

    def set(self, column: int, value: Any) -> None:
        """Overrule a column by a value or a signal."""
        exact = column in self._objects or is_signal(value)
        self.given[column] = value if exact else float(value)
        self._held = None

    def get(self, column: int) -> Any:
        """What a column is at the present communication point."""
        index = self._run.index
        self.put(index, index + 1)
        if column in self._objects:
            return self._objects[column][index]
        return float(self._run.external[index, column])

    def put(self, first: int, behind: int) -> None:
        """Write what overrules into the rows of some communication points."""
        if not self.given:
            return
        table = self._run.external
        if self._held is None:
            for column in self.given:
                if column in self._objects:
                    self._items.setdefault(column, list(self._objects[column]))
                elif column not in self._before:
                    self._before[column] = table[:, column].copy()
            held = {c: v for c, v in self.given.items() if isinstance(v, float)}
            self._held = (np.array(list(held), dtype=np.intp), np.array(list(held.values())))
        columns, values = self._held
        table[first:behind, columns] = values
        if len(columns) < len(self.given):
            for column in self._items.keys() & self.given.keys():
                self._put_objects(column, first, behind)
            moving = {c: v for c, v in self.given.items() if not isinstance(v, float)}
            signals = {self._names[c]: v for c, v in moving.items() if c not in self._items}
            table[first:behind, [c for c in moving if c not in self._items]] = (
                self._master.tabulate(signals, self._run.times[first:behind])
            )

    def _put_objects(self, column: int, first: int, behind: int) -> None:
        """The same for a column whose values travel as objects."""
        value, times = self.given[column], self._run.times[first:behind]
        if is_signal(value):
            (items,) = self._master.carried({self._names[column]: value}, times).values()
        else:
            items = [value] * times.size
        self._objects[column][first:behind] = items

    def replace(self, given: Mapping[int, Any]) -> None:
        """Return to the table as it was, overruled by something else from now on."""
        for column, values in self._before.items():
            self._run.external[:, column] = values
        for column, items in self._items.items():
            self._objects[column][:] = items
        self.given, self._held = dict(given), None

    def begin_as(self, other: DrivenInputs) -> None:
        """Take the first rows of another run, before its initialization."""
        self._run.external[:2] = other._first

    def tabulate(self) -> None:
        """Fill the table anew, for other times."""
        self._run.external[:] = self._master.tabulate(self._run.outline.signals, self._run.times)
        self._before.clear()
        self._held = None
