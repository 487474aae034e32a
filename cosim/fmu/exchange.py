"""Values of several variables of one FMU instance, exchanged through preallocated arrays."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import FmuCallError, FmuFileError, ValueRangeError
from .description import Variable

Vector = NDArray[np.float64]

DTYPES: dict[str, Any] = {
    "Float64": np.float64, "Float32": np.float32, "Int8": np.int8, "UInt8": np.uint8,
    "Int16": np.int16, "UInt16": np.uint16, "Int32": np.int32, "UInt32": np.uint32,
    "Int64": np.int64, "UInt64": np.uint64, "Boolean": np.bool_, "Boolean2": np.int32,
}  # fmt: skip
"""Numeric types and what they are in memory."""


@dataclass(frozen=True)
class Part:
    """Variables of one type inside a block, the arguments of one get or set call.

    Attributes:
        type: FMI type.
        references: value references.
        buffer: the values as C sees them; for `Float64` a view of the block's values.
        slots: positions of these values in the block.
        arguments: what a get or set call takes after the instance.
    """

    type: str
    references: NDArray[np.uint32]
    buffer: NDArray[Any]
    slots: slice | NDArray[np.intp]
    arguments: tuple[Any, ...]


class Caller(Protocol):
    """What makes the calls of a block: an instance."""

    @property
    def label(self) -> str:
        """What errors call it."""

    @property
    def binding(self) -> Any:
        """`fmi2` or `fmi3`."""

    def get_part(self, part: Part) -> None:
        """Fetch values."""

    def set_part(self, part: Part) -> None:
        """Give values."""

    def refusal(self, what: str) -> FmuCallError:
        """The error for what was not even tried."""


class Block:
    """Values of chosen variables in one preallocated array, and the calls that exchange them.

    Attributes:
        names: scalar names, in the order of `values`.
        values: numbers; integers and booleans are converted.
        parts: one per type.
    """

    def __init__(
        self, instance: Caller, variables: Sequence[Variable], values: Vector | None = None
    ) -> None:
        for variable in variables:
            if variable.type not in DTYPES:
                raise FmuFileError(
                    f"{instance.label}: {variable.name!r} is of type {variable.type}; only numbers "
                    "and booleans can be exchanged"
                )
        self._instance = instance
        self.names = tuple(name for variable in variables for name in variable.elements())
        self.values = np.zeros(len(self.names)) if values is None else values
        self.parts = tuple(self._split(variables))

    def _split(self, variables: Sequence[Variable]) -> Iterable[Part]:
        offset = 0
        found: dict[str, tuple[list[int], list[int]]] = {}
        for variable in variables:
            references, slots = found.setdefault(variable.type, ([], []))
            references.append(variable.reference)
            slots.extend(range(offset, offset + variable.size))
            offset += variable.size
        for type_, (references, slots) in found.items():
            whole = len(slots) == offset
            buffer = (
                self.values
                if whole and type_ == "Float64"
                else np.zeros(len(slots), dtype=DTYPES[type_])
            )
            numbers = np.array(references, dtype=np.uint32)
            yield Part(
                type_,
                numbers,
                buffer,
                slice(0, offset) if whole else np.array(slots, dtype=np.intp),
                self._instance.binding.values_arguments(numbers, buffer),
            )

    def get(self) -> Vector:
        """Fetch the values from the FMU."""
        for part in self.parts:
            self._instance.get_part(part)
            if part.buffer is not self.values:
                self.values[part.slots] = part.buffer
        return self.values

    def set(self, values: ArrayLike | None = None) -> None:
        """Give the values (the present ones if none are passed) to the FMU."""
        if values is not None:
            self.values[:] = values
        for part in self.parts:
            if part.buffer is not self.values:
                numbers = self.values[part.slots]
                if part.buffer.dtype.kind in "iu" and not _fit(numbers, part.buffer.dtype).all():
                    raise self.unfit(part)
                part.buffer[:] = numbers
            self._instance.set_part(part)

    def unfit(self, part: Part) -> FmuCallError:
        """The error for values that do not fit an integer type."""
        numbers = self.values[part.slots]
        bad = int(np.flatnonzero(~_fit(numbers, part.buffer.dtype))[0])
        name = self.names[int(np.arange(self.values.size)[part.slots][bad])]
        return self._instance.refusal(
            f"setting {name}: {numbers[bad]:g} does not fit type {part.type}"
        )


def _fit(numbers: Vector, dtype: Any) -> NDArray[np.bool_]:
    """Whether numbers can be cut to integers of this type."""
    limits, cut = np.iinfo(dtype), np.trunc(numbers)
    # float(max) of 64 bits rounds up to the first number that does not fit
    return np.asarray((cut >= float(limits.min)) & (cut < float(limits.max) + 1.0))


def check_values(where: str, variables: Sequence[Variable], value: Any) -> Vector:
    """Numbers for the elements of a variable, checked against its declaration.

    Raises:
        ValueRangeError: not numbers, a wrong count, not finite, or outside the bounds.
    """
    count = sum(variable.size for variable in variables)
    name = variables[0].name if len(variables) == 1 else variables[0].name.rpartition("[")[0]
    try:
        numbers = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueRangeError(f"{where}: {name} = {value!r} is not a number") from None
    if numbers.ndim == 0:
        numbers = np.full(count, float(numbers))
    if numbers.shape != (count,):
        raise ValueRangeError(f"{where}: {name} takes {count} values, but {numbers.size} are given")
    bounds = [variable for variable in variables for _ in range(variable.size)]
    for variable, number in zip(bounds, numbers.tolist(), strict=True):
        unit = f" {variable.symbol}" if variable.symbol not in ("", "1") else ""
        if not math.isfinite(number):
            raise ValueRangeError(f"{where}: {variable.name} = {number} is not finite")
        low = -math.inf if variable.minimum is None else variable.minimum
        high = math.inf if variable.maximum is None else variable.maximum
        if not low <= number <= high:
            raise ValueRangeError(
                f"{where}: {variable.name} = {number:.9g}{unit} is outside its bounds "
                f"[{low:.9g}, {high:.9g}]{unit}"
            )
    return numbers
