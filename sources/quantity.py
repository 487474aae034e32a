"""A declared variable: the only place where its name, unit, bounds and meaning are written."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from typing import Literal

from cosim.spec.hints import NO_HINTS, SearchHints

from .units import coherent

Variability = Literal["tunable", "fixed"]

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


WRENCH_UNITS = ("N",) * 3 + ("N.m",) * 3
"""Of a force and a moment in one vector."""
INERTIA_UNITS = tuple(
    ("kg", "kg.m", "kg.m2")[(row > 2) + (column > 2)]
    for row in range(6)
    for column in range(row, 6)
)
"""Of a 6x6 inertia, linear before angular, upper triangle row by row."""


@dataclass(frozen=True)
class Quantity:
    """A variable of a component or effect; XML, C layout, symbol tables and checks come from it.

    Attributes:
        name: local name, a plain identifier; a vector of `size` n is named `name[1]` ... `name[n]`.
        unit: SI unit in the notation of `cosim.spec.units`.
        units: units of the elements of a vector where they differ; `unit` is then `1`.
        text: one line of meaning, with the sign where it has one.
        start: start value, one number for all or one per element; a device file overrides it.
        minimum, maximum: bounds that the FMU enforces, None where open.
        nominal: typical magnitude, for solvers and scaling.
        size: 0 for a scalar, n for a vector.
        strength: marks the parameter of an effect whose value 0 means that the effect is absent.
        hints: of a parameter; what a search for its value should know.
        passed_on: of an output: part of the system is lost where no input takes it.
        variability: of a parameter; `fixed` ones can only be set before initialization.
    """

    name: str
    unit: str
    text: str
    start: float | tuple[float, ...] = 0.0
    minimum: float | None = None
    maximum: float | None = None
    nominal: float | None = None
    size: int = 0
    units: tuple[str, ...] = ()
    strength: bool = False
    hints: SearchHints = NO_HINTS
    passed_on: bool = False
    variability: Variability = "tunable"

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name):
            raise ValueError(f"quantity name {self.name!r} is not a plain identifier")
        for unit in (self.unit, *self.units):
            coherent(unit)
        if self.units and (len(self.units) != self.size or self.unit != "1"):
            raise ValueError(
                f"quantity {self.name!r}: {len(self.units)} units for {self.size} elements and "
                f"{self.unit!r} for all; elements with units of their own need one each and '1'"
            )
        if not self.text:
            raise ValueError(f"quantity {self.name!r} has no description")
        for value in self.starts():
            if not math.isfinite(value):
                raise ValueError(f"quantity {self.name!r}: start value {value} is not finite")
            if (self.minimum is not None and value < self.minimum) or (
                self.maximum is not None and value > self.maximum
            ):
                raise ValueError(
                    f"quantity {self.name!r}: start value {value} {self.unit} is outside "
                    f"[{self.minimum}, {self.maximum}]"
                )

    def starts(self) -> tuple[float, ...]:
        """Start values, one per element."""
        count = max(self.size, 1)
        if isinstance(self.start, tuple):
            if len(self.start) != count:
                raise ValueError(
                    f"quantity {self.name!r}: {len(self.start)} start values for {count} elements"
                )
            return tuple(float(value) for value in self.start)
        return (float(self.start),) * count

    def names(self) -> tuple[str, ...]:
        """Scalar names, `name` or `name[1]` ... `name[n]`."""
        if self.size == 0:
            return (self.name,)
        return tuple(f"{self.name}[{index + 1}]" for index in range(self.size))

    def elements(self) -> tuple[Quantity, ...]:
        """What is declared of each element: the quantity itself, with the element's own unit."""
        if not self.units:
            return (self,) * max(self.size, 1)
        return tuple(replace(self, unit=unit, units=()) for unit in self.units)

    def with_start(self, start: float | tuple[float, ...]) -> Quantity:
        """The same quantity with another start value."""
        return replace(self, start=start)
