"""Cells of a table as numbers: what is a gap, what is a number in other clothes, what is text."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
MISSING = {"", "na", "n/a", "#n/a", "nan", "-nan", "null", "none", "nil", "-", "--", "?", "missing"}
"""Cells that say that nothing was measured, in small letters."""
TRUTH = {"true": 1.0, "false": 0.0}
EXACT = 2**53
"""Integers up to here are exact as floating-point numbers; nanoseconds since 1970 are not."""
DAY = 10**15
"""What is taken off larger integers is a multiple of this, so that the rest is exact."""
_COMMA = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d+)?")


@dataclass(frozen=True)
class Gaps:
    """Cells of a column that hold no number.

    Attributes:
        empty: count of cells that say so (empty, `N/A`, `NaN`).
        strange: count of cells that hold something else.
        example: the first of these, or of the empty ones that say something.
        row: of the example, counted from 1 below the head.
        count: all cells.
    """

    empty: int = 0
    strange: int = 0
    example: str = ""
    row: int = 0
    count: int = 0

    @property
    def text(self) -> bool:
        """Whether the column holds text: most of what was written there is no number."""
        return self.strange > 0.5 * (self.count - self.empty)

    def __str__(self) -> str:
        number = self.empty + self.strange
        where = f" (the first {self.example!r} in row {self.row})" if self.row else ""
        return f"{number} of {self.count} cells hold no number{where}"


def numbers(cells: Sequence[str], comma: bool = False) -> tuple[Vector, Gaps, int]:
    """Values (NaN where there are none), what was no number, and what was taken off all values.

    Args:
        cells: as written.
        comma: whether a decimal comma is possible, since something else separates the columns.
    """
    plain = _plain(cells)
    if plain is not None:
        return plain[0], Gaps(count=len(cells)), plain[1]
    values = np.full(len(cells), np.nan)
    empty = strange = row = 0
    example = ""
    for index, cell in enumerate(cells):
        text = cell.strip().strip('"').strip()
        value = _number(text, comma)
        if value is not None and np.isfinite(value):
            values[index] = value
            continue
        if text.lower() in MISSING:
            empty += 1
        else:
            strange += 1
        if text and not row:
            example, row = text, index + 1
    return values, Gaps(empty, strange, example, row, len(cells)), 0


def _number(text: str, comma: bool) -> float | None:
    if text.lower() in TRUTH:
        return TRUTH[text.lower()]
    if comma and _COMMA.fullmatch(text):
        text = text.replace(",", ".")
    # int and float of Python take 1_000, which no log means
    if "_" in text:
        return None
    try:
        return float(text)
    except ValueError:
        return None


def _plain(cells: Sequence[str]) -> tuple[Vector, int] | None:
    """Cells that are all finite numbers, the usual case, and what was taken off them."""
    try:
        values = np.array([float(cell) for cell in cells], dtype=np.float64)
    except ValueError:
        return None
    if not np.isfinite(values).all() or any("_" in cell for cell in cells):
        return None
    if values.size and np.max(np.abs(values)) >= EXACT:
        try:
            return integers([int(cell) for cell in cells])
        except ValueError:  # large, but written with a point or an exponent
            return values, 0
    return values, 0


def integers(values: Iterable[int]) -> tuple[Vector, int]:
    """Whole numbers as floating-point ones, and what was taken off all to keep them exact."""
    whole = [int(value) for value in values]
    if not whole or max(map(abs, whole)) < EXACT:
        return np.array(whole, dtype=np.float64), 0
    origin = min(whole) // DAY * DAY
    return np.array([value - origin for value in whole], dtype=np.float64), origin
