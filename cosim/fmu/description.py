"""What an FMU says about itself, as plain objects of both versions of FMI."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from ..errors import UnknownNameError, listing
from ..spec.units import Unit

Causality = Literal[
    "parameter", "calculatedParameter", "structuralParameter", "input", "output", "local",
    "independent",
]  # fmt: skip
Start = float | bool | str | bytes | None

INTEGERS = (
    "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64", "Enumeration",
    "Enumeration2",
)  # fmt: skip


@dataclass(frozen=True)
class Variable:
    """One variable; an array of FMI 3 is one variable with `size` values.

    Attributes:
        name: as in the FMU; vectors of scalars are named `q[1]` ... `q[n]`.
        reference: its value reference.
        type: `Float64`, `Int32`, `Boolean` ..., `Boolean2` for the Boolean of FMI 2 (an int).
        causality, variability, initial: as in the FMU, with FMI's defaults filled in.
        unit: None where the FMU declares none.
        start: start values, one per element.
        minimum, maximum, nominal: None where open.
        dimensions: of an array of FMI 3, () for a scalar.
        index: of an element of an array, its position among the array's values; else None.
        relative: a difference, so that the offset of its unit does not count (FMI 2's
            relativeQuantity).
        items: of an enumeration, what its values are called.
        alias: of an alias of FMI 3, the variable whose second name it is; else "".
    """

    name: str
    reference: int
    type: str
    causality: str
    variability: str
    initial: str = ""
    unit: Unit | None = None
    start: tuple[Start, ...] = ()
    minimum: float | None = None
    maximum: float | None = None
    nominal: float | None = None
    text: str = ""
    dimensions: tuple[int, ...] = ()
    index: int | None = None
    relative: bool = False
    items: Mapping[int, str] | None = None
    alias: str = ""

    @property
    def size(self) -> int:
        """Number of values behind the value reference."""
        return math.prod(self.dimensions)

    @property
    def symbol(self) -> str:
        """The unit as written in the FMU, "" where it has none."""
        return self.unit.symbol if self.unit else ""

    def elements(self) -> tuple[str, ...]:
        """Names of the scalar elements: `q[1]` of a vector, `A[2,1]` of a matrix, row by row."""
        if not self.dimensions:
            return (self.name,)
        places = itertools.product(*(range(1, count + 1) for count in self.dimensions))
        return tuple(f"{self.name}[{','.join(map(str, place))}]" for place in places)

    def element(self, index: int) -> Variable:
        """One element of an array, as a scalar variable."""
        start = (self.start[index],) if len(self.start) == self.size else ()
        name = self.elements()[index]
        return replace(self, name=name, dimensions=(), index=index, start=start)


@dataclass(frozen=True)
class PowerPort:
    """Two groups of variables whose products are power, as our own FMUs declare them.

    Attributes:
        name: e.g. `flange_b`.
        effort, flow: names of the scalar variables, pairwise.
        sign: power INTO the component = sign * sum(effort * flow).
        causality: `gives_motion` or `gives_effort`.
    """

    name: str
    effort: tuple[str, ...]
    flow: tuple[str, ...]
    sign: int
    causality: str


@dataclass(frozen=True)
class Description:
    """A model description.

    Attributes:
        fmi: 2 or 3.
        name: the model's name; for our own FMUs the variant.
        token: GUID or instantiation token.
        identifier: model identifier of the co-simulation interface.
        variables: by name, in the FMU's order.
        dependencies: per output the inputs that it depends on directly.
        assumed: outputs whose dependencies the FMU does not declare (then it is all inputs).
        capabilities: attributes of the co-simulation interface.
        start, stop, step, tolerance: of the default experiment, None where not given.
        ports: power ports, from `extra/cosim/component.json`.
        extra: the whole of that file, empty for foreign FMUs.
    """

    fmi: Literal[2, 3]
    name: str
    token: str
    identifier: str
    variables: Mapping[str, Variable]
    dependencies: Mapping[str, tuple[str, ...]]
    assumed: frozenset[str]
    capabilities: Mapping[str, str]
    text: str = ""
    tool: str = ""
    version: str = ""
    start: float | None = None
    stop: float | None = None
    step: float | None = None
    tolerance: float | None = None
    ports: tuple[PowerPort, ...] = ()
    extra: Mapping[str, Any] = field(default_factory=dict)

    def can(self, capability: str) -> bool:
        """A boolean capability; FMI 2's and FMI 3's spelling are both accepted."""
        spellings = (
            capability,
            capability.replace("FMUState", "FMUstate"),
            capability.replace("Derivatives", "Derivative"),
        )
        return any(self.capabilities.get(spelling) in ("true", "1") for spelling in spellings)

    def of(self, causality: Causality) -> list[Variable]:
        """The variables of one causality, each under its first name."""
        return [v for v in self.variables.values() if v.causality == causality and not v.alias]

    def find(self, name: str) -> Variable:
        """A variable by name.

        Raises:
            UnknownNameError: with the nearest names.
        """
        if name not in self.variables:
            ordered = sorted(self.variables.values(), key=lambda v: v.causality == "local")
            names = [v.name for v in ordered]
            raise UnknownNameError(f"{self.name} has no variable {name!r}; {listing(names, name)}")
        return self.variables[name]

    def expand(self, name: str) -> list[Variable]:
        """What a name means: the variable `q`, an element of an array, or scalars that count up.

        FMI 2 has no arrays; there `q` means all of `q[1]`, `q[2]`, ... or `q[0]`, `q[1]`, ...

        Raises:
            UnknownNameError: neither exists.
        """
        if name in self.variables:
            return [self.variables[name]]
        whole = self.variables.get(name.rpartition("[")[0])
        if whole is not None and whole.dimensions:
            wanted, names = name.replace(" ", ""), whole.elements()
            if wanted not in names:
                raise UnknownNameError(
                    f"{self.name} has no element {name!r}: {whole.name} goes from {names[0]} to "
                    f"{names[-1]}"
                    if names
                    else f"{self.name}: {whole.name} is an array without elements"
                )
            return [whole.element(names.index(wanted))]
        for first in (1, 0):
            found: list[Variable] = []
            while f"{name}[{first + len(found)}]" in self.variables:
                found.append(self.variables[f"{name}[{first + len(found)}]"])
            if found:
                if first == 1 and f"{name}[0]" in self.variables:
                    found.insert(0, self.variables[f"{name}[0]"])
                return found
        return [self.find(name)]

    def whole(self, name: str) -> Variable:
        """The variable of the FMU that holds a scalar element (`x` for `x[2]` of an array)."""
        return self.variables.get(name) or self.find(name.rpartition("[")[0])
