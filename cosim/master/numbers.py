"""Scalar numbers of a system, checked together and given in one call per instance.

A calibration gives the same thirty parameters thousands of times; one by one, to check and to give
them takes as long as a short run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..fmu.exchange import Block
from ..fmu.instance import Instance
from ..system.system import System

Vector = NDArray[np.float64]
_LARGEST = float(np.finfo(np.float64).max)
_EXACT = 2**53
"""Integers up to here are floating-point numbers."""


class Numbers:
    """Places for numbers of these names.

    Args:
        system: whose variables they are.
        instances: of its members, in their order.
        names: full ones, of scalars of type `Float64`.
    """

    def __init__(self, system: System, instances: Sequence[Instance], names: Sequence[str]) -> None:
        found = [system.variables(name) for name in names]
        places = list(system.members)
        owners = [places.index(member.name) for member, _ in found]
        variables = [each[0] for _, each in found]
        self._order = np.array(sorted(range(len(names)), key=owners.__getitem__), dtype=np.intp)
        self._values = np.zeros(len(names))
        bounds = [(v.minimum, v.maximum) for v in variables]
        # infinite numbers are refused, too
        self._low = np.array(
            [-_LARGEST if low is None else max(low, -_LARGEST) for low, _ in bounds]
        )
        self._high = np.array(
            [_LARGEST if high is None else min(high, _LARGEST) for _, high in bounds]
        )
        self._blocks: list[Block] = []
        first = 0
        for owner in sorted(set(owners)):
            mine = [variables[k] for k in self._order.tolist() if owners[k] == owner]
            view = self._values[first : first + len(mine)]
            self._blocks.append(Block(instances[owner], mine, view))
            first += len(mine)

    @staticmethod
    def fit(system: System, names: Sequence[str]) -> bool:
        """Whether all are scalars of type `Float64`, which need nothing but to be within bounds."""
        return all(
            len(variables) == 1
            and variables[0].type == "Float64"
            and variables[0].size == 1
            and variables[0].index is None
            for _, variables in map(system.variables, names)
        )

    def give(self, values: Mapping[str, float]) -> bool:
        """Give them, in the order of the names; False if one cannot be, and then none is.

        Raises:
            FmuCallError: an FMU refused.
        """
        if set(map(type, values.values())) - {float} and not all(map(_exact, values.values())):
            return False
        given = np.array(list(values.values()), dtype=np.float64)
        if not np.all((given >= self._low) & (given <= self._high)):
            return False
        self._values[:] = given[self._order]
        for block in self._blocks:
            block.set()
        return True


def _exact(value: object) -> bool:
    """Whether it is exactly the same as a floating-point number."""
    if isinstance(value, int) and not isinstance(value, bool):
        return abs(value) <= _EXACT
    return isinstance(value, float)
