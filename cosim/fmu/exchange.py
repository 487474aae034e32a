"""Values of several variables of one FMU instance, exchanged through preallocated arrays."""

from __future__ import annotations

import ctypes as ct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import FmuCallError, FmuFileError
from .values import NUMBERS, OBJECTS, TYPES, fitting, refusal
from .variables import Variable

Vector = NDArray[np.float64]
Objects = NDArray[np.object_]


@dataclass(frozen=True)
class Part:
    """Variables of one type inside a block, the arguments of one get or set call.

    Attributes:
        type: FMI type.
        references: value references.
        buffer: the values as C sees them; for `Float64` a view of the block's values.
        slots: positions of these values in the block.
        arguments: what a get or set call takes after the instance.
        sizes: of binaries.
    """

    type: str
    references: NDArray[np.uint32]
    buffer: NDArray[Any]
    slots: slice | NDArray[np.intp]
    arguments: tuple[Any, ...]
    sizes: NDArray[np.uintp] = field(default_factory=lambda: np.zeros(0, dtype=np.uintp))


class Caller(Protocol):
    """What makes the calls of a block: an instance."""

    @property
    def label(self) -> str:
        """What errors call it."""

    @property
    def binding(self) -> Any:
        """`fmi2` or `fmi3`."""

    def note(self, text: str) -> None:
        """Note something once."""

    def get_part(self, part: Part) -> None:
        """Fetch values."""

    def set_part(self, part: Part) -> None:
        """Give values."""

    def refusal(self, what: str) -> FmuCallError:
        """The error for what was not even tried."""


class Block:
    """Values of chosen variables in preallocated arrays, and the calls that exchange them.

    Args:
        instance: whose variables they are.
        variables: whole ones, no elements of arrays.
        values, objects: where the values are, if not in arrays of the block's own.

    Attributes:
        names: scalar names, in the order of `values`.
        values: numbers; integers and booleans are converted.
        objects: of variables that travel as objects (`values.OBJECTS`); integers among them are
            in `values`, too, as the nearest double.
        parts: one per type.
        origins: per scalar where its value comes from, for error texts; "" where nobody said.
    """

    def __init__(
        self,
        instance: Caller,
        variables: Sequence[Variable],
        values: Vector | None = None,
        objects: Objects | None = None,
    ) -> None:
        for variable in variables:
            if variable.type not in TYPES:
                raise FmuFileError(
                    f"{instance.label}: {variable.name!r} is of type {variable.type}, whose "
                    "values cannot be exchanged"
                )
        self._instance = instance
        self.names = tuple(name for variable in variables for name in variable.elements())
        count = len(self.names)
        self.values = np.zeros(count) if values is None else values
        self.objects = np.full(count, None, dtype=object) if objects is None else objects
        self.origins = [""] * count
        self.parts = tuple(self._split(variables))
        self._kept: list[Any] = []

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
            dtype = NUMBERS.get(type_) or OBJECTS[type_]
            direct = whole and type_ == "Float64"
            buffer = self.values if direct else np.zeros(len(slots), dtype=dtype)
            sizes = np.zeros(len(slots) if type_ == "Binary" else 0, dtype=np.uintp)
            numbers = np.array(references, dtype=np.uint32)
            arguments = self._instance.binding.values_arguments(numbers, buffer)
            if type_ == "Binary":
                arguments = (*arguments[:2], sizes.ctypes.data, *arguments[2:])
            yield Part(
                type_,
                numbers,
                buffer,
                slice(0, offset) if whole else np.array(slots, dtype=np.intp),
                arguments,
                sizes,
            )

    def get(self) -> Vector:
        """Fetch the values from the FMU."""
        for part in self.parts:
            self._instance.get_part(part)
            if part.buffer is self.values:
                continue
            if part.type in OBJECTS:
                found = _objects(part)
                self.objects[part.slots] = found
                if part.type == "String" and not part.buffer.all():
                    slot = np.arange(len(self.names))[part.slots][int(np.argmin(part.buffer))]
                    self._instance.note(
                        f"gave no string for {self.names[slot]}, which counts as an empty one"
                    )
                if part.type in ("Int64", "UInt64"):
                    self.values[part.slots] = [float(item) for item in found]
            else:
                self.values[part.slots] = part.buffer
        return self.values

    def contents(self) -> list[Any]:
        """The values, objects where they travel as such."""
        numbers = self.values.tolist()
        return [
            number if item is None else item
            for number, item in zip(numbers, self.objects.tolist(), strict=True)
        ]

    def set(self, values: Sequence[Any] | Vector | None = None) -> None:
        """Give the values (the present ones if none are passed) to the FMU.

        Raises:
            FmuCallError: a value that its type cannot carry, or the FMU refused.
        """
        if values is not None:
            self._take(values)
        for part in self.parts:
            if part.buffer is self.values:
                pass
            elif part.type in OBJECTS:
                self._fill(part)
            else:
                numbers = self.values[part.slots]
                if not fitting(part.type, numbers).all():
                    raise self.unfit(part)
                part.buffer[:] = np.rint(numbers) if part.buffer.dtype.kind in "iub" else numbers
            self._instance.set_part(part)

    def _take(self, values: Sequence[Any] | Vector) -> None:
        for part in self.parts:
            for slot in np.arange(len(self.names))[part.slots].tolist():
                if part.type in OBJECTS:
                    self.objects[slot] = values[slot]
                else:
                    self.values[slot] = values[slot]

    def _fill(self, part: Part) -> None:
        """Put objects into the buffer of a part."""
        items = self.objects[part.slots].tolist()
        if part.type in ("Int64", "UInt64"):
            limits = np.iinfo(part.buffer.dtype)
            for slot, item in zip(
                np.arange(len(self.names))[part.slots].tolist(), items, strict=True
            ):
                if not limits.min <= item <= limits.max:
                    raise self._instance.refusal(
                        f"setting {self.names[slot]}{self._from(slot)}: {refusal(part.type, item)}"
                    )
            part.buffer[:] = items
            return
        contents = [item.encode() if isinstance(item, str) else item or b"" for item in items]
        self._kept = [ct.create_string_buffer(content) for content in contents]
        part.buffer[:] = [ct.addressof(buffer) for buffer in self._kept]
        if part.type == "Binary":
            part.sizes[:] = [len(content) for content in contents]

    def unfit(self, part: Part) -> FmuCallError:
        """The error for values that do not fit the type of their variables."""
        numbers = self.values[part.slots]
        bad = int(np.flatnonzero(~fitting(part.type, numbers))[0])
        slot = int(np.arange(self.values.size)[part.slots][bad])
        return self._instance.refusal(
            f"setting {self.names[slot]}{self._from(slot)}: "
            f"{refusal(part.type, float(numbers[bad]))}"
        )

    def _from(self, slot: int) -> str:
        return f" from {self.origins[slot]}" if self.origins[slot] else ""


def _objects(part: Part) -> list[Any]:
    """What a get call has put into the buffer of a part."""
    if part.type in ("Int64", "UInt64"):
        return [int(item) for item in part.buffer.tolist()]
    addresses = part.buffer.tolist()
    if part.type == "String":
        return [ct.string_at(item).decode("utf-8", "replace") if item else "" for item in addresses]
    sizes = part.sizes.tolist()
    return [
        ct.string_at(item, size) if item else b""
        for item, size in zip(addresses, sizes, strict=True)
    ]
