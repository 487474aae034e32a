"""Cells of a table as numbers: what is a gap, what is a number in other clothes, what is text."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..reading.schema import shown

Vector = NDArray[np.float64]
MISSING = {"", "na", "n/a", "#n/a", "nan", "-nan", "null", "none", "nil", "-", "--", "?", "missing"}
"""Cells that say that nothing was measured, in small letters."""
TRUTH = {"true": 1.0, "false": 0.0}
EXACT = 2**53
"""Integers up to here are exact as floating-point numbers; nanoseconds since 1970 are not."""
DAY = 10**15
"""What is taken off larger integers is a multiple of this, so that the rest is exact."""
_COMMA = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d+)?")
_POINT = re.compile(r"[+-]?\d*\.\d+(?:[eE][+-]?\d+)?")
_GROUPS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")
_POINTS = re.compile(r"[+-]?[1-9]\d{0,2}(\.\d{3})+")
"""What may be 1234 as well as 1.234."""
_SPACES = " '\u2019\u00a0\u2009\u202f"
_GROUPED = re.compile(
    r"[+-]?\d{1,3}(?:(?:,\d{3})+\.\d*|(?:\.\d{3})+,\d*|(?:,\d{3}){2,}|(?:\.\d{3}){2,}"
    r"|(?:[" + _SPACES + r"]\d{3})+(?:[.,]\d*)?)"
)
"""Numbers whose thousands are separated."""
_MEASURED = re.compile(
    r"([+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?) *([a-zA-Z%\u00b0\u00b5\u03bc].*)"
)
"""A number and its unit."""


@dataclass(frozen=True)
class Gaps:
    """Cells of a column that hold no number.

    Attributes:
        empty: count of cells that say so (empty, `N/A`, `NaN`).
        strange: count of cells that hold something else.
        example: the first of these, or of the empty ones that say something.
        row: of the example, counted from 1 below the head.
        count: all cells.
        fault: why the numbers may mean others than they seem to.
    """

    empty: int = 0
    strange: int = 0
    example: str = ""
    row: int = 0
    count: int = 0
    fault: str = ""

    @property
    def text(self) -> bool:
        """Whether the column holds text: most of what was written there is no clear number."""
        return bool(self.fault) or self.strange > 0.5 * (self.count - self.empty)

    def __str__(self) -> str:
        number = self.empty + self.strange
        where = f" (the first {shown(self.example)} in row {self.row})" if self.row else ""
        return f"{number} of {self.count} cells hold no number{where}"


def numbers(cells: Sequence[str], comma: bool = False) -> tuple[Vector, Gaps, int]:
    """Values (NaN where there are none), what was no number, and what was taken off all values.

    Args:
        cells: as written.
        comma: whether a decimal comma is possible.
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


def ambiguity(cells: Sequence[str], unit: Callable[[str], str]) -> str:
    """Why numbers of a column may mean others than they seem to, "" if they do not.

    Args:
        cells: as written.
        unit: the unit that a text means, "" if none.
    """
    texts = [cell.strip().strip('"').strip() for cell in cells]
    if grouped := next((text for text in texts if _GROUPED.fullmatch(text)), ""):
        return f"has the cell {grouped!r}; write numbers without separators of thousands"
    comma = next((text for text in texts if _COMMA.fullmatch(text)), "")
    point = next((text for text in texts if _POINT.fullmatch(text)), "")
    if comma and point:
        return (
            f"has the cells {comma!r} and {point!r}; write numbers with one decimal mark, and "
            "without separators of thousands"
        )
    for text in texts:
        if (found := _MEASURED.fullmatch(text)) and unit(found[2]):
            return (
                f"has the cell {text!r} among numbers; write all of them in one unit, and the unit "
                "into the head"
            )
    return ""


def decimal_comma(cells: Sequence[str]) -> tuple[bool, str]:
    """Whether a comma among the cells can be nothing but a decimal one; else a cell that has one.

    `1,234` may be 1234, `0,234` and `1,5` may not.
    """
    commas = [text for cell in cells if _COMMA.fullmatch(text := cell.strip().strip('"').strip())]
    sure = any(not _GROUPS.fullmatch(text) for text in commas)
    return sure, commas[0] if commas and not sure else ""


def thousands(cells: Sequence[str]) -> str:
    """A cell whose point may separate thousands, "" if a point among the cells may not."""
    points = [text for cell in cells if "." in (text := cell.strip().strip('"').strip())]
    return points[0] if points and all(map(_POINTS.fullmatch, points)) else ""


def _number(text: str, comma: bool) -> float | None:
    if text.lower() in TRUTH:
        return TRUTH[text.lower()]
    if comma and _COMMA.fullmatch(text):
        text = text.replace(",", ".")
    # int and float of Python take 1_000, which no log means
    if "_" in text:
        return None
    try:
        return float(text.replace("\u2212", "-"))  # the minus sign of printed texts
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
