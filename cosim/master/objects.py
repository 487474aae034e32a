"""Values that do not travel as doubles: integers of 64 bits, strings and binaries.

The interpreter passes them on beside the array of numbers. What would lose something on its way is
refused: an integer beyond 2^53 for a double, a number that is not whole for an integer.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FmuCallError
from ..fmu.exchange import Objects
from ..fmu.values import whole_number
from .plan import Layout

Vector = NDArray[np.float64]


class ObjectPassing:
    """What each operation does to the objects of a run; false if there are none.

    Args:
        layout: where values are.
        observed: names of what is recorded.
        driven: per column of the external inputs that carries objects, one per communication point.

    Attributes:
        kept: recorded objects by name.
    """

    def __init__(
        self, layout: Layout, observed: Sequence[str], driven: Mapping[int, Sequence[Any]]
    ) -> None:
        self._layout, self._driven = layout, driven
        carries = layout.objects
        ends = zip(layout.copy_source.tolist(), layout.copy_target.tolist(), strict=True)
        self._copies = [i for i, pair in enumerate(ends) if carries[pair[0]] or carries[pair[1]]]
        self._recorded = {
            name: int(slot)
            for name, slot in zip(observed, layout.record_source, strict=True)
            if carries[slot]
        }
        self.kept: dict[str, list[Any]] = {name: [] for name in self._recorded}
        self._noted: dict[str, Any] = {}

    def __bool__(self) -> bool:
        return bool(self._copies or self._driven or self._recorded)

    def restart(self) -> None:
        """Forget what was recorded."""
        for items in self.kept.values():
            items.clear()

    def drive(self, objects: Objects, index: int) -> None:
        """Values of external inputs at a communication point."""
        for column, items in self._driven.items():
            objects[self._layout.external[column]] = items[index]

    def keep(self, objects: Objects) -> None:
        """Record."""
        for name, slot in self._recorded.items():
            self.kept[name].append(objects[slot])

    def note(self, objects: Objects) -> None:
        """Remember what would be recorded."""
        self._noted = {name: objects[slot] for name, slot in self._recorded.items()}

    def keep_noted(self) -> None:
        """Record what was remembered last."""
        for name, item in self._noted.items():
            self.kept[name].append(item)

    def copy(self, values: Vector, objects: Objects, first: int, last: int) -> None:
        """Pass on what goes through the connections `first` to before `last`.

        Raises:
            FmuCallError: a value that its target cannot carry, with both ends.
        """
        layout = self._layout
        for index in self._copies:
            if first <= index < last:
                source, target = int(layout.copy_source[index]), int(layout.copy_target[index])
                given = objects[source] if layout.objects[source] else float(values[source])
                if (layout.copy_gain[index], layout.copy_offset[index]) != (1.0, 0.0):
                    self._exact(source, target, given)
                    given = float(values[target])
                if not layout.objects[target]:
                    self._exact(source, target, given)
                    continue
                whole = given if isinstance(given, (str, bytes)) else whole_number(given)
                if whole is None:
                    raise self._refused(source, target, given, "is no whole number")
                objects[target] = whole

    def _exact(self, source: int, target: int, given: Any) -> None:
        """Refuse an integer that a double does not carry."""
        if isinstance(given, int) and float(given) != given:
            raise self._refused(source, target, given, "is not exact as a floating-point number")

    def _refused(self, source: int, target: int, given: Any, why: str) -> FmuCallError:
        names = self._layout.names
        return FmuCallError(
            f"{names[source]} = {given!r} {why}, so it does not go to {names[target]}; convert it "
            "in one of the two FMUs"
        )
