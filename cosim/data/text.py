"""Tables of text: their encoding, what separates their columns, and the habits of their heads.

Read are UTF-8 and UTF-16 (with a byte order mark), and else Latin-1, whose bytes all mean
something; columns separated by semicolons, tabs, commas, bars or blanks; a decimal comma where the
comma does not separate; heads such as `speed [rad/s]` and `speed (rad/s)`, heads in the last
comment before the numbers, a second row of units, and the first line `sep=;` of spreadsheets.
Anything else is refused in one sentence.
"""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ScenarioError, UnitError
from ..reading.limits import DATA
from ..spec.units import parse
from .cells import EXACT, Gaps, ambiguity, decimal_comma, numbers, thousands

Vector = NDArray[np.float64]
SEPARATORS = (";", "\t", ",", "|")
"""Tried in this order: a comma may be in the numbers of a table that something else separates."""
COMMENTS = ("#", "%")
_CELL = 9
"""Bytes of memory per byte of a file: seven digits are a text of 56 and two pointers."""
_DIGITS = 16
"""Of integers from 2^53 on, at least."""
_SQUARE = re.compile(r"(?P<name>.*?)\s*\[(?P<unit>(?:1/)?[^\]\d][^\]]*)\]")
_EXCEL = re.compile(r'\s*"?sep=(?P<separator>[;\t,| ])"?\s*', re.IGNORECASE)
"""A first line by which spreadsheets are told what separates the columns."""
_ROUND = re.compile(r".*?\((?P<unit>[^()]+)\)")
_SIGNS = {
    "°C": "degC", "°": "deg", "º": "deg", "\u03a9": "ohm", "\u2126": "ohm", "Ohm": "ohm",
    "µ": "u", "μ": "u", "·": ".", "²": "2", "³": "3", "⁻¹": "-1", "⁻²": "-2",
    "degree": "deg", "degrees": "deg", "deg/sec": "deg/s", "rad/sec": "rad/s",
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "msec": "ms", "msecs": "ms",
    "milliseconds": "ms", "usec": "us", "microseconds": "us", "nsec": "ns", "nanoseconds": "ns",
    "RPM": "rpm", "1/min": "rpm", "Nm": "N.m", "N m": "N.m",
}  # fmt: skip
"""Other spellings of units: signs that are replaced wherever they stand, words as a whole."""


@dataclass
class Table:
    """What a file holds.

    Attributes:
        columns: values by name; gaps are NaN.
        units: by name; "" where unknown.
        gaps: of the columns that have any.
        texts: gaps of the columns that hold no numbers, which are in `columns` neither.
        origins: what was taken off all values of a column to keep them exact.
        notes: what was assumed in reading.
        exact: values that doubles do not carry, as they are: texts, and integers beyond 2^53.
    """

    columns: dict[str, Vector] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    gaps: dict[str, Gaps] = field(default_factory=dict)
    texts: dict[str, Gaps] = field(default_factory=dict)
    origins: dict[str, int] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    exact: dict[str, list[Any]] = field(default_factory=dict)

    def add(
        self,
        name: str,
        values: Vector,
        gaps: Gaps,
        origin: int = 0,
        exact: Sequence[Any] | None = None,
    ) -> None:
        """Take a column in, as numbers or text; `exact`: as it is, if doubles do not carry it."""
        if exact is not None and (gaps.text or _large(exact)):
            self.exact[name] = list(exact)
        if gaps.text:
            self.texts[name] = gaps
            return
        self.columns[name] = values
        if gaps.empty or gaps.strange:
            self.gaps[name] = gaps
        if origin:
            self.origins[name] = origin


def spelled(unit: str) -> str:
    """A unit as `spec.units` spells it, "" if it knows none such."""
    text = unit.strip()
    for sign, usual in _SIGNS.items():
        text = usual if text == sign else text
        if not sign.isascii():
            text = text.replace(sign, usual)
    try:
        parse(text)
    except UnitError:
        return ""
    return text


def head(text: str) -> tuple[str, str]:
    """Name and unit of a column's head.

    Square brackets are no part of the name. Round ones stay, and are a unit if they hold one.
    """
    text = text.strip().strip('"').strip()
    if match := _SQUARE.fullmatch(text):
        return match["name"], spelled(match["unit"]) or match["unit"]
    if match := _ROUND.fullmatch(text):
        return text, spelled(match["unit"])
    return text, ""


def text_table(path: Path) -> Table:
    """Read a table of text.

    Raises:
        ScenarioError: it is too large, or no table with one head per column.
    """
    table = Table()
    try:
        if excess := DATA.excess(_CELL * path.stat().st_size):
            raise ScenarioError(f"{path}: {excess}")
        lines = _decoded(path, table).splitlines()
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read ({error.strerror})") from error
    lines = [line for line in lines if line.strip()]
    told = _EXCEL.fullmatch(lines[0]) if lines else None
    lines = lines[1:] if told else lines
    begin = list(takewhile(lambda line: line.startswith(COMMENTS), lines))
    lines = [line for line in lines if not line.startswith(COMMENTS)]
    if not lines:
        raise ScenarioError(f"{path}: is empty")
    separator = told["separator"] if told else _separator(lines)
    rows = list(_split(lines, separator, path))
    heads = rows.pop(0)
    if _numeric(heads):
        last = next(_split([line[1:] for line in begin[-1:]], separator, path), [])
        if len(last) != len(heads) or _numeric(last):
            raise ScenarioError(
                f"{path}: its first row {lines[0][:60]!r} is numbers; the first row must name the "
                "columns, e.g. time,speed"
            )
        rows.insert(0, heads)
        heads = last
    names = [head(item) for item in heads]
    names = [(name or f"column_{i}", unit) for i, (name, unit) in enumerate(names, 1)]
    seen = [name for name, _ in names]
    if twice := next((name for name in seen if seen.count(name) > 1), None):
        raise ScenarioError(f"{path}: has two columns {twice!r}; rename one of them")
    units = _units(rows, names)
    wide = next((i for i, row in enumerate(rows, 1) if any(map(str.strip, row[len(names) :]))), 0)
    if wide:
        raise ScenarioError(
            f"{path}: row {wide} has {len(rows[wide - 1])} cells, but the head names {len(names)} "
            f"columns, taken as separated by {separator!r}; a decimal comma needs another "
            "separator, e.g. a semicolon"
        )
    columns = {
        name: [row[index] if index < len(row) else "" for row in rows]
        for index, (name, _) in enumerate(names)
    }
    commas = {
        name: decimal_comma(cells)
        for name, cells in columns.items() if any("," in cell for cell in cells)
    }  # fmt: skip
    sure = any(found for found, _ in commas.values())
    for (name, cells), unit in zip(columns.items(), units, strict=True):
        values, gaps, origin = numbers(cells, comma=True)
        if not gaps.text and (gaps.strange or name in commas):
            fault = ambiguity(cells, spelled)
            if not fault and not sure and (unclear := commas.get(name, (False, ""))[1]):
                fault = (
                    f"has the cell {unclear!r}, which may mean {unclear.replace(',', '')} or "
                    f"{unclear.replace(',', '.', 1)}; write numbers without separators of "
                    "thousands, or with a decimal point"
                )
            gaps = replace(gaps, fault=fault)
        elif sure and (unclear := thousands(cells)):
            fault = (
                f"has the cell {unclear!r}, which may mean {unclear.replace('.', '')} or, beside "
                f"the decimal commas of other columns, {unclear.replace('.', ',')}; write numbers "
                "without separators of thousands, and all with one decimal mark"
            )
            gaps = replace(gaps, fault=fault)
        table.units[name] = unit
        table.add(name, values, gaps, origin, exact_of(cells, gaps))
    return table


def exact_of(cells: Sequence[str], gaps: Gaps) -> list[Any] | None:
    """Cells as texts, or as integers if they are such beyond 2^53; None if doubles carry them."""
    if gaps.text:
        return [cell.strip() for cell in cells]
    if gaps.empty or gaps.strange or max((len(cell) for cell in cells), default=0) < _DIGITS:
        return None
    try:
        return [int(cell) for cell in cells]
    except ValueError:  # no integers
        return None


def _large(values: Sequence[Any]) -> bool:
    return all(isinstance(v, int) for v in values) and max(map(abs, values), default=0) > EXACT


def _decoded(path: Path, table: Table) -> str:
    raw = path.read_bytes()
    wide = raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    code = "utf-16" if wide else "utf-8-sig"
    try:
        text = raw.decode(code)
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
        table.notes.append("is not UTF-8 and was read as Latin-1")
    if "\0" in text:
        raise ScenarioError(
            f"{path}: is no text (zero bytes in it); write it as UTF-8, or as UTF-16 with a byte "
            "order mark"
        )
    return text


def _separator(lines: list[str]) -> str:
    """What separates the columns: what is in the head as often as in most rows.

    One more may end the head, or the rows.
    """
    some = lines[:1] + lines[1:50]
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


def _split(lines: list[str], separator: str, path: Path) -> Iterator[list[str]]:
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


def _numeric(row: list[str]) -> bool:
    """Whether cells are numbers, as no head is."""
    values, gaps, _ = numbers(row, comma=True)
    return gaps.strange == 0 and bool(np.isfinite(values).any())


def _units(rows: list[list[str]], names: list[tuple[str, str]]) -> list[str]:
    """Units of the columns; a first row that holds units is taken away.

    It holds no number but `1`, half of the rest are known units or the first is one of time, and
    below these stand numbers. Other units stay as they are written, as those in heads do.
    """
    units = [unit for _, unit in names]
    if len(rows) < 2 or len(rows[0]) != len(names) or any(units):
        return units
    cells = [cell.strip().strip("[]()") for cell in rows[0]]
    said = [cell for cell in cells if cell not in ("", "-", "1")]
    known = [index for index, cell in enumerate(cells) if cell in said and spelled(cell)]
    if any(numbers([cell])[1].strange == 0 for cell in said):
        return units
    timed = known[:1] == [0] and parse(spelled(cells[0])).exponents == parse("s").exponents
    below = [rows[1][index] for index in known if index < len(rows[1])]
    if not (timed or 2 * len(known) >= len(said)) or not _numeric(below):
        return units
    rows.pop(0)
    return [spelled(cell) or cell for cell in cells]
