"""The clocks of a log, by which its columns are brought together: units, origins, order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..data.logs import Log
from ..errors import ScenarioError, UnitError
from ..spec.units import parse
from .scales import known

Vector = NDArray[np.float64]
FACTORS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""[s] of the units of clocks."""
EPOCH = (6.3e8, 4.1e9)
"""[s] from 1970 to 1990 and to 2100: a number is a time since 1970 in the unit in which it lies
between them. What counts since a computer began is there after weeks in the next finer unit only,
but after minutes in those below."""
SINCE = 1e9
"""[s] from 1970 to 2001: where one clock counts from 1970, another that is beyond this in seconds
does so, too."""
LONG = 20.0
"""A clock that spans more than so many times its samples at its usual interval has jumped."""


def since_1970(size: float) -> str:
    """The unit in which a number is a time since 1970, "" if there is none."""
    units = (unit for unit, factor in FACTORS.items() if EPOCH[0] <= size * factor <= EPOCH[1])
    return next(units, "")


class Clocks:
    """Clocks of a log: in seconds where the main one's unit is known, else in its own.

    A unit is known from the column's head, as that of times since 1970, or because the mapping
    tells it (`tell`).

    Args:
        log: with the clocks.
        main: name of the main one.

    Attributes:
        factor: [s] of a unit of the main clock, None if that is not known.

    Raises:
        UnitError: the head of the main clock is in what is no time.
    """

    def __init__(self, log: Log, main: str) -> None:
        self.log, self.main = log, main
        self.factor = self._factor(main)
        self._values = log[main]

    def tell(self, values: Vector, factor: float | None) -> None:
        """Take the main clock as the mapping makes it.

        Args:
            values: of the clock, in its unit.
            factor: [s] of this unit, None if that is not known.
        """
        self._values, self.factor = values, factor

    def _factor(self, name: str) -> float | None:
        """[s] of one of a clock's units, None if that is not known."""
        unit = self.log.units.get(name, "")
        if unit:
            found = known(unit, f"{self.log.name}: clock {name}")
            if found.exponents != parse("s").exponents:
                raise UnitError(
                    f"{self.log.name}: clock {name!r} is in {unit!r} (SI {found.dimension()}), "
                    "which is no time; name another column with time"
                )
            return found.factor
        epoch = since_1970(self._size(name))
        return FACTORS[epoch] if epoch not in ("", "s") else None

    def _size(self, name: str) -> float:
        """How far a clock is from 0, in its unit."""
        values = self.log[name]
        size = abs(float(np.nanmedian(values))) if np.isfinite(values).any() else 0.0
        return size + self.log.origins.get(name, 0)

    def __call__(self, name: str) -> Vector:
        """A clock, counted from where the main one is.

        Raises:
            UnitError: its head is in what is no time.
        """
        if name == self.main:
            return self._values if self.factor is None else self._values * self.factor
        values, own, main = self.log[name], self._factor(name), self.factor
        since = self._size(name) >= SINCE / (own or 1.0)
        if since and self._size(self.main) >= SINCE / (main or 1.0) and (own or main):
            own, main = own or 1.0, main or 1.0
        if main is None:
            return values
        own = main if own is None else own
        origin, zero = (self.log.origins.get(one, 0) for one in (name, self.main))
        return values * own + ((origin - zero) * own if own == main else origin * own - zero * main)

    def own(self, source: str) -> str:
        """The clock of a column: of several files, that of its own with the main clock's name."""
        file, dot, _ = source.rpartition(".")
        mine = f"{file}{dot}{self.main.rpartition('.')[2]}"
        return mine if dot and mine in self.log.columns else self.main


def with_times(log: Log, main: str, clock: Vector) -> tuple[Log, Vector]:
    """The log without the rows that have no time.

    Raises:
        ScenarioError: none has one.
    """
    good = np.isfinite(clock)
    if good.all() and clock.size:
        return log, clock
    if not good.any():
        raise ScenarioError(f"{log.name}: its clock {main!r} has no values; {_rows(clock.size)}")
    columns = {
        name: values[good] if values.shape == good.shape else values
        for name, values in log.columns.items()
    }
    lost = int(np.count_nonzero(~good))
    note = f"{lost} rows without a time in {main!r} are left out"
    return replace(log, columns=columns, notes=(*log.notes, note)), clock[good]


def _rows(count: int) -> str:
    return "the log has no rows" if not count else f"none of its {count} cells is a number"


def check_span(log: Log, main: str, clock: Vector) -> None:
    """Refuse to fill a clock that has jumped with samples.

    Raises:
        ScenarioError: with where it jumped.
    """
    steps = np.diff(clock)
    if not steps.size:
        return
    usual = float(np.median(steps))
    if not usual > 0.0 or clock[-1] - clock[0] > LONG * usual * clock.size:
        at = int(np.argmax(np.abs(steps)))
        raise ScenarioError(
            f"{log.name}: clock {main!r} jumps by {steps[at]:.6g} after row {at + 1} (usual "
            f"interval {usual:.4g}), so it cannot be resampled; leave out the rows on one side, or "
            "give each side a file and a run of its own (samples are those of the grid)"
        )


def apart(log: Log, column: str, clock: str, count: int) -> str:
    """The sentence for a column whose clock has another length."""
    return (
        f"{log.name} has {log[column].size} values of {column!r}, but {count} times of its clock "
        f"{clock!r}; name its own clock with time in [columns], or mend the file"
    )


def check_rising(log: Log, name: str, clock: Vector, twice: bool = False) -> None:
    """Refuse a clock that goes back or, unless a time may be there twice, stands still.

    Args:
        log, name: of the clock.
        clock: its times.
        twice: whether a time may be there twice, as on a column's own clock, which is read whole.

    Raises:
        ScenarioError: with the row, and how often.
    """
    steps = np.diff(clock[np.isfinite(clock)])
    bad = np.flatnonzero(steps < 0.0 if twice else steps <= 0.0)
    if bad.size:
        at = int(bad[0])
        what = "stands still" if steps[at] == 0.0 else f"goes back by {-steps[at]:.6g}"
        raise ScenarioError(
            f"{log.name}: clock {name!r} {what} after row {at + 1}"
            + (f", and so in {bad.size} places" if bad.size > 1 else "")
            + "; leave out rows that are there twice and sort the others"
            + ("" if twice else ", or take the rows on one side with samples")
        )
