"""Values of variables: which a type can carry, and what is made of the numbers that it is given.

Float types and integers up to 32 bits travel as doubles. Integers of 64 bits, strings and binaries
travel as the Python objects that they are (`OBJECTS`), since doubles carry 53 bits.

A number is taken for an integer if it is one up to rounding, |v - round(v)| <= 1e-9 + 4 eps |v|,
and refused otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ValueRangeError, listing
from ..reading.schema import is_finite, shown
from .attributes import INTEGERS
from .variables import Variable

NUMBERS: dict[str, Any] = {
    "Float64": np.float64, "Float32": np.float32, "Float32Whole": np.float32,
    "Int8": np.int8, "UInt8": np.uint8, "Int16": np.int16, "UInt16": np.uint16,
    "Int32": np.int32, "UInt32": np.uint32, "Enumeration": np.int64, "Enumeration2": np.int32,
    "Boolean": np.bool_, "Boolean2": np.int32,
}  # fmt: skip
"""Types that travel as doubles, and what they are in memory; `Float32Whole` is a `Float32` that is
given integers, which it carries exactly or not at all."""
OBJECTS: dict[str, Any] = {
    "Int64": np.int64, "UInt64": np.uint64, "String": np.uintp, "Binary": np.uintp,
}  # fmt: skip
"""Types that travel as objects; strings and binaries are addresses in memory."""
TYPES = (*NUMBERS, *OBJECTS)
"""Types whose values can be exchanged: all but clocks."""
_PLAIN = {"Boolean2": "Boolean", "Enumeration2": "Enumeration", "Float32Whole": "Float32"}
"""What FMI calls them."""
ROUNDING = 1e-9
"""Largest distance from a whole number: gains and units of a connection cost some bits of 1e-16,
and nobody means an integer by a number that is farther away."""


def boolean(type_: str) -> bool:
    """Whether a type is that of a truth value."""
    return type_.startswith("Boolean")


def whole(numbers: ArrayLike) -> NDArray[np.bool_]:
    """Which numbers are whole up to rounding."""
    given = np.asarray(numbers, dtype=np.float64)
    margin = ROUNDING + 4.0 * np.finfo(np.float64).eps * np.abs(given)
    with np.errstate(invalid="ignore"):  # infinite numbers are not whole
        return np.asarray(np.abs(given - np.rint(given)) <= margin)


def fitting(type_: str, numbers: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which numbers a type that travels as double can carry."""
    dtype = np.dtype(NUMBERS[type_])
    if type_ == "Float64":
        return np.ones(numbers.shape, dtype=np.bool_)
    if type_ == "Float32":
        return np.asarray(~(np.abs(numbers) > np.finfo(np.float32).max))  # nan stays nan
    if type_ == "Float32Whole":
        with np.errstate(over="ignore"):
            return np.asarray((numbers.astype(np.float32) == numbers) | np.isnan(numbers))
    if boolean(type_):
        rounded = np.rint(numbers)
        return np.asarray(whole(numbers) & ((rounded == 0.0) | (rounded == 1.0)))
    limits, rounded = np.iinfo(dtype), np.rint(numbers)
    # float(max) of 64 bits rounds up to the first number that does not fit
    inside = (rounded >= float(limits.min)) & (rounded < float(limits.max) + 1.0)
    return np.asarray(whole(numbers) & inside)


def whole_number(value: Any) -> int | None:
    """The integer that a number means, exactly if it is an integer; None if it means none."""
    if isinstance(value, (bool, np.bool_, int, np.integer)):
        return int(value)
    number = float(value)
    return round(number) if bool(whole(number)) else None


def refusal(type_: str, value: Any) -> str:
    """Why a type does not carry a number."""
    name = _PLAIN.get(type_, type_)
    if type_ == "Float32Whole" and abs(value) <= float(np.finfo(np.float32).max):
        return f"{int(value)} is an integer that type {name} does not carry exactly"
    if isinstance(value, float) and (boolean(type_) or not bool(whole(value))):
        what = "neither true (1) nor false (0)" if boolean(type_) else "no whole number"
        return f"{value!r} is {what}, and type {name} carries nothing else"
    return f"{value!r} does not fit type {name}"


def check_values(where: str, variables: Sequence[Variable], value: Any) -> list[Any]:
    """Values for the elements of a variable, checked against its declaration.

    Args:
        where: what errors begin with.
        variables: the variable, or scalars that count up.
        value: one value for all elements, one per element, or rows of a matrix.

    Returns:
        One value per element: float, int, bool, str or bytes.

    Raises:
        ValueRangeError: of another type or size, not finite, not exact, or outside the bounds.
    """
    first = variables[0]
    name = first.name if len(variables) == 1 else first.name.rpartition("[")[0]
    each = [variable for variable in variables for _ in range(variable.size)]
    given = _flat(where, name, first, len(each), value)
    return [_checked(where, variable, item) for variable, item in zip(each, given, strict=True)]


def _flat(where: str, name: str, first: Variable, count: int, value: Any) -> list[Any]:
    """The values one by one."""
    if isinstance(value, np.ndarray) and not value.ndim:
        value = value.item()
    if not isinstance(value, (Sequence, np.ndarray)) or isinstance(value, (str, bytes)):
        return [value] * count
    items = value.tolist() if isinstance(value, np.ndarray) else list(value)
    shape: list[int] = [len(items)]
    while items and all(isinstance(item, (list, tuple)) for item in items):
        if len({len(item) for item in items}) > 1:
            raise ValueRangeError(f"{where}: {name}: its rows are not of one length")
        shape.append(len(items[0]))
        items = [inner for item in items for inner in item]
    wanted = first.dimensions if len(first.dimensions) > 1 else (count,)
    if tuple(shape) not in (wanted, (count,)):
        sizes = " x ".join(map(str, wanted))
        rows = f"; write a matrix as a list of {wanted[0]} rows" if len(wanted) > 1 else ""
        raise ValueRangeError(
            f"{where}: {name} takes {sizes} values, but {' x '.join(map(str, shape))} are "
            f"given{rows}"
        )
    return items


def plain(value: Any) -> Any:
    """Lists in place of arrays and tuples, so that two values can be compared."""
    return [plain(v) for v in value] if isinstance(value, (list, tuple, np.ndarray)) else value


def _checked(where: str, variable: Variable, value: Any) -> Any:
    """One value, as its type carries it."""
    name, type_ = variable.name, variable.type
    if type_ == "String":
        if not isinstance(value, str):
            raise ValueRangeError(f"{where}: {name} = {value!r} is not a string")
        return value
    if type_ == "Binary":
        return _bytes(where, name, value)
    if variable.items and isinstance(value, str):
        found = [number for number, item in variable.items.items() if item == value]
        if not found:
            raise ValueRangeError(
                f"{where}: {name} = {value!r} is no item of its enumeration; "
                f"{listing(variable.items.values(), value)}"
            )
        return found[0]
    if not isinstance(value, (int, float, np.integer, np.floating, np.bool_)):
        raise ValueRangeError(f"{where}: {name} = {shown(value)} is not a number")
    if isinstance(value, (bool, np.bool_)) and type_.startswith("Enumeration"):
        raise ValueRangeError(
            f"{where}: {name} = {str(bool(value)).lower()} is a truth value, and {name} an "
            "enumeration; give the name or the number of an item"
        )
    if not is_finite(value):
        raise ValueRangeError(f"{where}: {name} = {shown(value)} is not finite")
    number: Any = float(value)
    if not (type_ in INTEGERS or boolean(type_)) and number != value:
        raise ValueRangeError(
            f"{where}: {name} = {value} is not exact as a floating-point number of type {type_}; "
            "take a number that is, or write it with a decimal point"
        )
    if type_ in INTEGERS:
        number = whole_number(value)
    elif boolean(type_):
        number = bool(round(float(value))) if fitting(type_, np.array(number)).all() else None
    if number is None:
        raise ValueRangeError(f"{where}: {name}: {refusal(type_, float(value))}")
    if variable.items and number not in variable.items:
        names = ", ".join(f"{key} ({item})" for key, item in variable.items.items())
        raise ValueRangeError(f"{where}: {name} = {number} is no item of its enumeration: {names}")
    _check_bounds(where, variable, number)
    if type_ in ("Int64", "UInt64"):
        fits = np.iinfo(OBJECTS[type_]).min <= number <= np.iinfo(OBJECTS[type_]).max
    else:
        fits = bool(fitting(type_, np.array(float(number))).all())
    if not fits:
        raise ValueRangeError(f"{where}: {name}: {refusal(type_, number)}")
    if type_ == "Float32" and isinstance(value, (int, np.integer)):
        type_ = "Float32Whole"
        if not fitting(type_, np.array(number)).all():
            raise ValueRangeError(f"{where}: {name}: {refusal(type_, number)}")
    return number


def _bytes(where: str, name: str, value: Any) -> bytes:
    if isinstance(value, bytes):
        return value
    try:
        return bytes.fromhex(value)
    except (TypeError, ValueError):
        raise ValueRangeError(
            f"{where}: {name} = {value!r} is neither bytes nor a string of hexadecimal digits"
        ) from None


def _check_bounds(where: str, variable: Variable, number: Any) -> None:
    low = -math.inf if variable.minimum is None else variable.minimum
    high = math.inf if variable.maximum is None else variable.maximum
    if not low <= number <= high:
        unit = f" {variable.symbol}" if variable.symbol not in ("", "1") else ""
        text = f"{number:.9g}" if isinstance(number, float) else str(number)
        raise ValueRangeError(
            f"{where}: {variable.name} = {text}{unit} is outside its bounds "
            f"[{low:.9g}, {high:.9g}]{unit}"
        )
