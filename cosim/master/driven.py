"""The driven inputs of a run in steps: what was set takes the place of what was known before."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .interpreter import Interpreter
from .master import Master

Vector = NDArray[np.float64]


class DrivenInputs:
    """The table of a run's driven inputs, part of which is overruled.

    Args:
        master: tabulates signals.
        run: whose table it is.

    Attributes:
        given: column -> number or signal that overrules it.
    """

    def __init__(self, master: Master, run: Interpreter) -> None:
        self._master, self._run = master, run
        self._names = tuple(run.outline.signals)
        self._first = run.external[:2].copy()
        self._before: dict[int, Vector] = {}
        self._held: tuple[NDArray[np.intp], Vector] | None = None
        self.given: dict[int, Any] = {}

    def set(self, column: int, value: Any) -> None:
        """Overrule a column by a number or a signal."""
        self.given[column] = value
        self._held = None

    def put(self, first: int, behind: int) -> None:
        """Write what overrules into the rows of some communication points."""
        if not self.given:
            return
        table = self._run.external
        if self._held is None:
            for column in self.given:
                if column not in self._before:
                    self._before[column] = table[:, column].copy()
            held = {c: v for c, v in self.given.items() if isinstance(v, float)}
            self._held = (np.array(list(held), dtype=np.intp), np.array(list(held.values())))
        columns, values = self._held
        table[first:behind, columns] = values
        if len(columns) < len(self.given):
            moving = {c: v for c, v in self.given.items() if not isinstance(v, float)}
            signals = {self._names[c]: v for c, v in moving.items()}
            table[first:behind, list(moving)] = self._master.tabulate(
                signals, self._run.times[first:behind]
            )

    def replace(self, given: Mapping[int, Any]) -> None:
        """Return to the table as it was, overruled by something else from now on."""
        for column, values in self._before.items():
            self._run.external[:, column] = values
        self.given, self._held = dict(given), None

    def begin_as(self, other: DrivenInputs) -> None:
        """Take the first rows of another run, before its initialization."""
        self._run.external[:2] = other._first

    def tabulate(self) -> None:
        """Fill the table anew, for other times."""
        self._run.external[:] = self._master.tabulate(self._run.outline.signals, self._run.times)
        self._before.clear()
        self._held = None
