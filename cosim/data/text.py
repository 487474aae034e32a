"""Tables of text: their encoding, what separates their columns, and the habits of their heads.

Read are UTF-8 and UTF-16 (with a byte order mark), and else Latin-1, whose bytes all mean
something; columns separated by semicolons, tabs, commas, bars or blanks; a decimal comma where the
comma does not separate; heads such as `speed [rad/s]` and `speed (rad/s)`, heads in the last
comment before the numbers, lines of a recorder before them, a second row of units, and the first
line `sep=;` of spreadsheets; dates and times as clocks (`dates`).
Anything else is refused in one sentence.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ScenarioError, UnitError
from ..reading.limits import DATA
from ..spec.units import parse
from . import dates
from .cells import EXACT, Gaps, ambiguity, decimal_comma, integers, numbers, thousands
from .rows import before, numeric, separator_of, split

Vector = NDArray[np.float64]
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

    def add_clock(self, name: str, counts: Sequence[int | None]) -> None:
        """Take a clock in that counts nanoseconds; None where there is no time."""
        known = np.array([count is not None for count in counts], dtype=np.bool_)
        values = np.full(known.size, np.nan)
        values[known], origin = integers(count for count in counts if count is not None)
        missing = int(known.size - known.sum())
        self.units[name] = "ns"
        self.add(name, values, Gaps(missing, count=known.size), origin,
                 None if missing else [count for count in counts if count is not None])  # fmt: skip


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
    if not told and (left := before(lines, path)):
        table.notes.append(
            f"what stands before the head of the table is left out ({left} lines, the first "
            f"{lines[0].strip()[:40]!r}); its head is {lines[left].strip()[:60]!r}"
        )
        lines = lines[left:]
    separator = told["separator"] if told else separator_of(lines)
    rows = list(split(lines, separator, path))
    heads = rows.pop(0)
    if numeric(heads):
        last = next(split([line[1:] for line in begin[-1:]], separator, path), [])
        if len(last) != len(heads) or numeric(last):
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
    told_units = dict(zip(columns, units, strict=True))
    if moments := dates.beside(columns):
        day, time, columns[time] = moments
        del columns[day]
        table.notes.append(f"columns {day!r} and {time!r} are one clock {time!r}")
    commas = {
        name: decimal_comma(cells)
        for name, cells in columns.items() if any("," in cell for cell in cells)
    }  # fmt: skip
    sure = any(found for found, _ in commas.values())
    for name, cells in columns.items():
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
        times = dates.nanoseconds(cells) if gaps.text else None
        if times is not None:
            table.add_clock(name, times[0])
            table.notes.append(f"column {name!r} holds {times[1]}")
            continue
        table.units[name] = told_units[name]
        table.add(name, values, gaps, origin, exact_of(cells, gaps))
    for clock, (first, counts) in dates.in_two_parts(table.columns).items():
        table.add_clock(clock, counts)
        table.columns = {clock: table.columns[clock], **table.columns}
        table.notes.append(f"columns {first!r} and its fraction are the clock {clock!r} in ns")
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
    if not (timed or 2 * len(known) >= len(said)) or not numeric(below):
        return units
    rows.pop(0)
    return [spelled(cell) or cell for cell in cells]
