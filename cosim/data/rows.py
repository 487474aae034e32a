"""Rows of a table of text: what separates their cells, and where the table begins."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..errors import ScenarioError
from .cells import numbers

SEPARATORS = (";", "\t", ",", "|")
"""Tried in this order: a comma may be in the numbers of a table that something else separates."""
_SOME = 50
"""Lines by which it is told what separates them."""
_MOST = 60
"""Lines that may stand before a table: heads of oscilloscopes have some twenty."""


def separator_of(lines: list[str]) -> str:
    """What separates the columns: what is in the head as often as in most rows.

    One more may end the head, or the rows.
    """
    some = lines[:_SOME]
    for mark in SEPARATORS:
        counts = [{line.count(mark), line.removesuffix(mark).count(mark)} for line in some]
        same = sum(not count.isdisjoint(counts[0]) for count in counts)
        if mark in lines[0] and same > 0.5 * len(counts):
            return mark
    if "," in lines[0]:
        return ","
    blanks = [len(line.split()) for line in some]
    if blanks[0] > 1 and blanks.count(blanks[0]) == len(blanks):
        return " "
    return ","


def split(lines: list[str], separator: str, path: Path) -> Iterator[list[str]]:
    """Rows of lines.

    Raises:
        ScenarioError: they are none of a table, or a quotation mark makes one of several rows.
    """
    if separator == " ":
        yield from (line.split() for line in lines)
        return
    reader = csv.reader(lines, delimiter=separator, skipinitialspace=True)
    begin, least = 0, 0
    try:
        for row in reader:
            end = reader.line_num
            # a cell may go over several lines, but one that holds the marks of a row is none
            least = least or 2 * (len(row) - 1)
            over = lines[begin:end] if end > begin + 1 else []
            if over and sum(line.count(separator) for line in over) >= least > 0:
                raise ScenarioError(
                    f"{path}: the quotation mark in {lines[begin][-60:]!r} is not closed in its "
                    f"line and takes in the {end - begin - 1} rows after it; close it or take it "
                    "away"
                )
            begin = end
            yield row
    except csv.Error as error:
        raise ScenarioError(
            f"{path}: is not a table of text ({error}); save it as CSV in UTF-8"
        ) from error


def numeric(row: list[str]) -> bool:
    """Whether cells are numbers, as no head is."""
    values, gaps, _ = numbers(row, comma=True)
    return gaps.strange == 0 and bool(np.isfinite(values).any())


def before(lines: list[str], path: Path) -> int:
    """Lines before the head of a table: those of a recorder that tells of itself.

    The first row with more numbers than texts is data. The row before it is the head, or the one
    before that, where units stand between; a head names as many columns as there are numbers. If
    the first line does, too, it is the head.
    """
    some = lines[: _MOST + _SOME]
    for first in range(1, min(_MOST, len(some))):
        mark = separator_of(some[first:])
        row = _cells(some[first], mark, path)
        if len(row) < 2 or not _data(row):
            continue
        if len(_cells(some[0], mark, path)) >= len(row):
            return 0
        for head in range(first - 1, max(first - 3, 0), -1):
            above = _cells(some[head - 1], mark, path)
            if len(_cells(some[head], mark, path)) == len(row) and len(above) < len(row):
                return head
        return 0
    return 0


def _cells(line: str, mark: str, path: Path) -> list[str]:
    """Cells of a line up to the last one that holds something."""
    cells = next(split([line], mark, path), [])
    while cells and not cells[-1].strip():
        cells.pop()
    return cells


def _data(row: list[str]) -> bool:
    """Whether most cells that hold something are numbers."""
    said = [cell for cell in row if cell.strip()]
    values, _, _ = numbers(said, comma=True)
    return 2 * int(np.isfinite(values).sum()) > len(said)
