"""Values given by name, checked once and given to an FMU as often as wanted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Protocol

from ..errors import ValueRangeError
from .description import Description
from .exchange import Block, Caller
from .values import check_values


class Owner(Caller, Protocol):
    """Whose variables they are: an instance."""

    time: float

    @property
    def description(self) -> Description:
        """Of its FMU."""

    def fetch(self, *names: str) -> list[Any]:
        """Present values."""


class Assignment:
    """Values of variables, ready to be given.

    Elements of an array leave the other ones as they are now, or at their start values before
    initialization.

    Args:
        owner: whose variables they are.
        values: by name; a vector takes a list, a matrix a list of rows.

    Raises:
        ValueRangeError: of another type or size, not finite, not exact, or out of bounds.
    """

    def __init__(self, owner: Owner, values: Mapping[str, Any]) -> None:
        self._settings: list[tuple[Block, list[Any]]] = []
        arrays: dict[str, list[Any]] = {}
        for name, value in values.items():
            variables = owner.description.expand(name)
            found = check_values(owner.label, variables, value)
            if variables[0].index is None:
                self._settings.append((Block(owner, variables), found))
                continue
            whole = owner.description.whole(name)
            if whole.name not in arrays:
                begun = not math.isnan(owner.time)
                arrays[whole.name] = owner.fetch(whole.name) if begun else list(whole.start)
            if len(arrays[whole.name]) != whole.size:
                raise ValueRangeError(
                    f"{owner.label}: {whole.name} has no start values; set it as a whole"
                )
            arrays[whole.name][variables[0].index] = found[0]
        for name, items in arrays.items():
            self._settings.append((Block(owner, [owner.description.find(name)]), items))

    def give(self) -> None:
        """Give them.

        Raises:
            FmuCallError: the FMU refused.
        """
        for block, items in self._settings:
            block.set(items)
