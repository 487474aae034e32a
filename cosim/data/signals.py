"""What drives an open input over time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any, Literal, Protocol, TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import wrong
from ..errors import ValueRangeError
from ..reading.schema import is_finite

Vector = NDArray[np.float64]
CLOCK = 1e-3
"""Fraction of the shorter of the intervals beside a sample within which two times are the same:
logs keep sample times rounded (often to 32 bits), so a sample may seem to come just after the
communication point that it belongs to."""
EARLY = 0.1
"""Nor is it more than this part of a communication step: commands that are logged when they change
may stand for minutes. What is taken early by so little is nearer to its time than a step later."""
EXACT = 1e-9
"""The same for tables that are held beyond their ends [s]: they are written, not logged, and may
have long intervals; only communication points carry rounding."""


PAUSE = 3.0
"""Intervals of a table longer than this many usual ones are pauses: it may end a usual interval
before the run, not a pause."""


class Signal(Protocol):
    """Values over time, in `unit`."""

    @property
    def unit(self) -> str:
        """Unit of the values; "" if it is the input's."""
        ...

    @property
    def text(self) -> str:
        """Where it comes from, for recordings and error texts."""
        ...

    def at(self, times: Vector) -> Vector:
        """Values at these times."""
        ...


@dataclass(frozen=True)
class Constant:
    """The same value at all times."""

    value: float | str | bytes
    unit: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.value, (str, bytes)) and not is_finite(self.value):
            raise ValueRangeError(f"constant input {self.value} is not finite")

    @property
    def text(self) -> str:
        """The value."""
        if isinstance(self.value, (str, bytes)):
            return repr(self.value)
        return f"{self.value:g} {self.unit}".strip()

    def at(self, times: Vector) -> Vector:
        """The value, once per time.

        Raises:
            ValueRangeError: it is no number.
        """
        if isinstance(self.value, (str, bytes)):
            raise ValueRangeError(f"constant input {self.value!r} is not a number")
        return np.full(times.shape, float(self.value))

    def objects(self, times: Vector) -> list[Any]:
        """The value as it is, once per time; none if a double carries it."""
        exact = not isinstance(self.value, (str, bytes)) and float(self.value) == self.value
        return [] if exact else [self.value] * len(times)


@dataclass(frozen=True)
class Function:
    """A function of time that takes an array and returns one, or a number."""

    function: Callable[[Vector], ArrayLike]
    unit: str = ""
    text: str = "function of time"

    def at(self, times: Vector) -> Vector:
        """Values at these times.

        Raises:
            ValueRangeError: the function gives something else.
        """
        try:
            values = np.asarray(self.function(times))
            if np.iscomplexobj(values):
                raise TypeError("it returns complex numbers")
            return np.broadcast_to(values.astype(np.float64), times.shape)
        except (TypeError, ValueError) as error:
            raise ValueRangeError(
                f"{self.text} {self.function!r} does not give one number per time ({error}); it is "
                "given an array of times: take numpy's functions (np.sin for math.sin), or "
                "np.vectorize(function)"
            ) from error


class Table:
    """Samples, held until the next one or connected linearly.

    Args:
        times: increasing [s].
        values: one per time.
        unit: of the values.
        interpolation: `hold` (a set value held between samples) or `linear`.
        text: where it comes from.
        extend: hold the first and last value beyond the table; else leaving it by more than a
            sample interval is an error (the longest one, but for pauses: `PAUSE`).

    Raises:
        ValueRangeError: times that do not increase, or values of several kinds, or not finite.
    """

    def __init__(
        self,
        times: ArrayLike,
        values: ArrayLike,
        *,
        unit: str = "",
        interpolation: Literal["hold", "linear"] = "hold",
        text: str = "table",
        extend: bool = False,
    ) -> None:
        try:  # copies: who shares a table relies on it
            self.times = np.array(times, dtype=np.float64)
            self._objects = _exact(values)
            self.values = (
                np.full(self.times.shape, np.nan)
                if self._objects and isinstance(self._objects[0], (str, bytes))
                else np.array(values, dtype=np.float64)
            )
        except (TypeError, ValueError, OverflowError) as error:
            raise ValueRangeError(
                f"{text}: its times are not all numbers, or its values neither all numbers nor all "
                f"texts ({error})"
            ) from None
        self.unit, self.interpolation, self.text, self.extend = unit, interpolation, text, extend
        if self.times.ndim != 1 or self.times.shape != self.values.shape or not self.times.size:
            raise ValueRangeError(
                f"{text}: {self.times.size} times and {self.values.size} values; give one value "
                "per time"
            )
        if interpolation not in ("hold", "linear"):
            raise ValueRangeError(f"{text}: interpolation {interpolation!r} is not hold or linear")
        bad = np.flatnonzero(np.diff(self.times) <= 0.0)
        if bad.size:
            raise ValueRangeError(f"{text}: times do not increase at {self.times[bad[0]]:.9g} s")
        if self._objects and interpolation == "linear":
            raise ValueRangeError(
                f"{text}: holds integers or texts, which cannot be interpolated; take hold"
            )
        bad = np.flatnonzero(~(np.isfinite(self.values) & np.isfinite(self.times)))
        if bad.size and not self._objects:
            raise ValueRangeError(
                f"{text}: {bad.size} of {self.values.size} values are not finite, the first "
                f"({self.values[bad[0]]}) at t = {self.times[bad[0]]:.9g} s; an input needs a "
                "value at all times: fill the gap or choose another column"
            )

    def scaled(self, factor: float) -> Table:
        """The same signal, so many times as large."""
        return Table(
            self.times, np.asarray(self.values) * factor, unit=self.unit,
            interpolation=self.interpolation, text=self.text, extend=self.extend,
        )  # fmt: skip

    def at(self, times: Vector) -> Vector:
        """Values at these times.

        Raises:
            ValueRangeError: outside the table (without `extend`).
        """
        self._check(times)
        found: Vector = (
            np.interp(times, self.times, self.values)
            if self.interpolation == "linear"
            else self.values[self._held(times)]
        )
        return found

    def objects(self, times: Vector) -> list[Any]:
        """Values at these times, exact integers and texts as they are; none if doubles do."""
        if not self._objects:
            return []
        self._check(times)
        return [self._objects[i] for i in self._held(times).tolist()]

    def _held(self, times: Vector) -> NDArray[np.intp]:
        intervals = np.append(np.append(np.inf, np.diff(self.times)), np.inf)
        most = EXACT if self.extend else np.inf
        if times.size > 1:
            most = min(most, EARLY * float(np.min(np.diff(times))))
        early = np.minimum(CLOCK * np.minimum(intervals[:-1], intervals[1:]), most)
        early[~np.isfinite(early)] = 0.0  # a single sample
        index = np.searchsorted(self.times - early, times, side="right") - 1
        return np.maximum(index, 0)

    def _check(self, times: Vector) -> None:
        """Refuse times outside."""
        if not self.extend and times.size:
            first, last = self.times[0], self.times[-1]
            intervals = np.diff(self.times)
            before = after = 0.0
            if intervals.size:
                usual = min(float(np.max(intervals)), PAUSE * float(np.median(intervals)))
                before = (1.0 + CLOCK) * max(usual, float(intervals[0]))
                after = (1.0 + CLOCK) * max(usual, float(intervals[-1]))
            if times[0] < first - before or times[-1] > last + after:
                raise ValueRangeError(
                    f"{self.text}: covers {first:.12g} s to {last:.12g} s, but the run needs "
                    f"{times[0]:.12g} s to {times[-1]:.12g} s; shorten the run, start it where the "
                    "table starts, or extend the table"
                )


class Shifted:
    """A signal that comes some time later, or earlier, than it says.

    What is held is given as its mean over an interval, so that it follows the shift smoothly where
    its steps lie between communication points. Beyond a table's ends its first and last value hold,
    if it comes at another time.

    Args:
        signal: which.
        later: by so much [s]; negative for earlier, 0 for in time.
        interval: over which what is held is read, from the time that is asked for on [s].
    """

    def __init__(self, signal: Signal, later: float, interval: float) -> None:
        self.signal, self.later, self.interval = signal, later, interval
        self.unit = signal.unit
        self.text = f"{signal.text}, {later:+.6g} s" if later else signal.text

    def at(self, times: Vector) -> Vector:
        """Values at these times."""
        wanted, table = times - self.later, self.signal
        if not isinstance(table, Table):
            values: Vector = table.at(wanted)
            return values
        if not self.later:
            table.at(times[[0, -1]])  # says where it ends too early
        if table.interpolation == "linear":
            return np.asarray(np.interp(wanted, table.times, table.values))
        knots = table.times
        areas = np.concatenate([[0.0], np.cumsum(np.diff(knots) * table.values[:-1])])

        def area(t: Vector) -> Vector:
            before = np.minimum(t - knots[0], 0.0) * table.values[0]
            after = np.maximum(t - knots[-1], 0.0) * table.values[-1]
            return np.asarray(np.interp(t, knots, areas) + before + after)

        mean: Vector = (area(wanted + self.interval) - area(wanted)) / self.interval
        return mean


def _exact(values: ArrayLike) -> list[Any]:
    """Values that doubles do not carry, as they are; none if doubles do."""
    items = values.tolist() if isinstance(values, np.ndarray) else values
    if not isinstance(items, Sequence):
        return []
    numbers = all(isinstance(item, (int, float, np.integer, np.floating)) for item in items)
    whole = (item for item in items if isinstance(item, (int, np.integer)))
    if numbers and any(float(item) != item for item in whole):
        return [item.item() if isinstance(item, np.generic) else item for item in items]
    if items and all(isinstance(item, (str, bytes)) for item in items):
        return list(items)
    return []


@dataclass(frozen=True)
class SignalVector:
    """One signal per element of a vector or matrix (row by row)."""

    signals: tuple[Signal, ...]


def objects(signal: Signal, times: Vector) -> list[Any]:
    """Values at these times as they are, if doubles do not carry them; else none."""
    exact = getattr(signal, "objects", None)
    return list(exact(times)) if exact is not None else []


def is_signal(value: Any) -> TypeGuard[Signal]:
    """Whether something is a signal; functions of numpy and series of pandas have an `at`, too."""
    return all(hasattr(value, name) for name in ("at", "unit", "text"))


def as_signal(value: Signal | float | str | bytes | Callable[[Vector], ArrayLike]) -> Signal:
    """A signal from a number, a text or a function of time."""
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and not value.ndim):
        value = value.item()
    if isinstance(value, (int, float, str, bytes)):
        return Constant(value)
    if isinstance(value, Real):  # a fraction
        return Constant(float(value))
    if is_signal(value):
        return value
    if not callable(value):
        raise wrong("what drives an input", value, "a signal, a number, a text or a function")
    return Function(value)
