"""A declared variable: the only place where its name, unit, bounds and meaning are written."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from typing import Literal

from .units import coherent

Variability = Literal["tunable", "fixed"]
Mix = Literal["", "turn", "shift"]

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


@dataclass(frozen=True)
class Quantity:
    """A variable of a component or effect; XML, C layout, symbol tables and checks come from it.

    Attributes:
        name: local name, a plain identifier; a vector of `size` n is named `name[1]` ... `name[n]`.
        unit: SI unit in the notation of `cosim.spec.units`.
        text: one line of meaning, with the sign where it has one.
        start: start value, one number for all or one per element; a device file overrides it.
        minimum, maximum: bounds that the FMU enforces, None where open.
        nominal: typical magnitude, for solvers and scaling.
        size: 0 for a scalar, n for a vector.
        strength: marks the parameter of an effect whose value 0 means that the effect is absent.
        mix: how two simulations tell this parameter of a weak effect: `turn`, an angle (effect =
            strength * (cos * effect at 0 + sin * effect at pi/2)); `shift`, an offset
            (effect = strength * (effect at 0 + value * derivative)).
        tries: values that a search should try, where a model with another one tells nothing of the
            right one (cycles per revolution); for a strength, values near which fits begin.
        lattice: distance of the values at which the model is exact, 0 if it is everywhere (a held
            signal is delayed by whole samples; between, its steps are smeared).
        visits: output of the component among whose values along a run the right value is, for a
            parameter that tells nothing where it is wrong (where a patch lies).
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
    strength: bool = False
    mix: Mix = ""
    tries: tuple[float, ...] = ()
    lattice: float = 0.0
    visits: str = ""
    passed_on: bool = False
    variability: Variability = "tunable"

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name):
            raise ValueError(f"quantity name {self.name!r} is not a plain identifier")
        coherent(self.unit)
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

    def with_start(self, start: float | tuple[float, ...]) -> Quantity:
        """The same quantity with another start value."""
        return replace(self, start=start)
