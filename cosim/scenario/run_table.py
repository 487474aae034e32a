"""Scenarios with one run per row of a table; `{column}` stands for the row's value.

    [table]
    file = "data/table2.csv"
    join = { file = "data/table3.csv", on = "set" }
    name = "SET{set}_{run}"
    columns.turn = "2 * pi / yaw_rate"
    columns.e2_others = "others(e2, set)"

Added columns are arithmetic of the others: + - * / **, the functions below, pi, and
`others(column, group)`, the mean of a column over the other rows with the same value in `group`
(what the rest of a group says of the row that is left out).
"""

from __future__ import annotations

import ast
import csv
import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import ScenarioError, listing
from ..files import is_file
from ..reading.limits import TEXT
from ..reading.schema import keyed
from .shape import TABLE, TEXTS

PLACE = re.compile(r"\{(\w+)\}")
_KEYS = {"file", "name", "join", "columns"}
_NAMED = ("parameters", "options")
_BINARY: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_FUNCTIONS: dict[str, Callable[..., float]] = {
    "sqrt": math.sqrt,
    "hypot": math.hypot,
    "sin": math.sin,
    "cos": math.cos,
    "atan2": math.atan2,
    "abs": abs,
    "min": min,
    "max": max,
}
Row = dict[str, str]


def table_runs(path: Path, entry: Any) -> dict[str, Row]:
    """Run name -> row of the table.

    Args:
        path: the scenario file, for error texts and relative paths.
        entry: its `[table]`.

    Raises:
        ScenarioError: a file, column or expression that cannot be read.
    """
    if not isinstance(entry, dict) or not {"file", "name"} <= set(entry):
        raise ScenarioError(f'{path}: [table] needs file and name, e.g. name = "SET{{set}}"')
    unknown = sorted(set(entry) - _KEYS)
    if unknown:
        raise ScenarioError(
            f"{path}: [table] has no key {unknown[0]!r}; {listing(sorted(_KEYS), unknown[0])}"
        )
    keyed(TABLE)(entry, f"{path}: [table]")
    rows = _rows(path.parent / entry["file"])
    if "join" in entry:
        if not {"file", "on"} <= set(entry["join"]):
            raise ScenarioError(f"{path}: [table] join needs file and on, the column to join by")
        file, on = path.parent / entry["join"]["file"], entry["join"]["on"]
        others = _named(_rows(file), lambda row: row.get(on) or None, f"{file}: {on} =")
        lacking = [row.get(on) for row in rows if row.get(on) not in others]
        if lacking:
            raise ScenarioError(f"{file}: has no row with {on} = {lacking[0]}")
        rows = [{**others[row[on]], **row} for row in rows]
    for name, text in entry.get("columns", {}).items():
        values = [evaluate(f"{path}: column {name}", str(text), row, rows) for row in rows]
        for row, value in zip(rows, values, strict=True):
            row[name] = repr(value)
    names = _named(
        rows,
        lambda row: str(fill(str(path), entry["name"], row, textual=True)),
        f"{path.parent / entry['file']}: name = {entry['name']!r} gives",
    )
    if not names:
        raise ScenarioError(f"{path.parent / entry['file']}: has no rows, so there are no runs")
    return names


def _named(rows: Sequence[Row], name: Callable[[Row], str | None], what: str) -> dict[str, Row]:
    """Rows by names of their own.

    Raises:
        ScenarioError: two have one name, or one has an empty one.
    """
    found: dict[str, int] = {}
    for number, row in enumerate(rows, 1):
        called = name(row)
        if called is None:
            continue
        if not called:
            raise ScenarioError(f"{what} nothing in row {number}; fill the cell")
        if called in found:
            raise ScenarioError(
                f"{what} {called!r} in rows {found[called]} and {number}; make them differ (by "
                "another column, say) or leave one out"
            )
        found[called] = number
    return {called: rows[number - 1] for called, number in found.items()}


def _rows(file: Path) -> list[Row]:
    if not is_file(file):
        raise ScenarioError(f"{file}: there is no such file")
    if excess := TEXT.excess(file.stat().st_size):
        raise ScenarioError(f"{file}: {excess}")
    try:
        with file.open(encoding="utf-8-sig", newline="") as handle:
            rows = list(csv.DictReader(handle))
    except (csv.Error, UnicodeError) as error:
        raise ScenarioError(f"{file}: is not a CSV table in UTF-8 ({error})") from error
    except OSError as error:
        raise ScenarioError(f"{file}: cannot be read ({error.strerror})") from error
    for number, row in enumerate(rows, 1):
        if None in row or None in row.values():
            raise ScenarioError(
                f"{file}: row {number} has more or fewer cells than the head; correct it"
            )
    return rows


# -- places ----------------------------------------------------------------------------------------


def _number(text: Any) -> float:
    """What a cell says; `1_5` is a name, though Python reads it as 15.

    Raises:
        ValueError: it is no number.
    """
    if "_" in str(text):
        raise ValueError(f"{text!r} is no number")
    return float(text)


def _value(text: str) -> Any:
    try:
        return _number(text)
    except ValueError:
        return text


def fill(where: str, item: Any, row: Mapping[str, str], *, textual: bool = False) -> Any:
    """A scenario's content with the row's values in the places of `{column}`.

    A place that is a whole text becomes a number if it is one, except where texts are expected.
    Names of parameters and options are not the scenario's keys.

    Args:
        where: of the content, for error texts.
        item: the content.
        row: column -> value.
        textual: numbers stay texts.

    Raises:
        ScenarioError: the row has no such column.
    """
    if isinstance(item, list):
        return [fill(where, entry, row, textual=textual) for entry in item]
    if isinstance(item, dict):
        return {
            key: _fill_names(where, entry, row)
            if key in _NAMED
            else fill(where, entry, row, textual=key in TEXTS and not isinstance(entry, dict))
            for key, entry in item.items()
        }
    if not isinstance(item, str):
        return item

    def of(match: re.Match[str]) -> str:
        if match[1] not in row:
            raise ScenarioError(f"{where}: nothing is called {match[0]}; {listing(row, match[1])}")
        return row[match[1]]

    filled = PLACE.sub(of, item)
    return _value(filled) if PLACE.fullmatch(item) and not textual else filled


def _fill_names(where: str, item: Any, row: Mapping[str, str]) -> Any:
    """The same of a table whose keys are names of others."""
    if isinstance(item, dict):
        return {key: _fill_names(where, entry, row) for key, entry in item.items()}
    return fill(where, item, row)


# -- added columns ---------------------------------------------------------------------------------


def evaluate(
    what: str, text: str, row: Mapping[str, Any], rows: Sequence[Mapping[str, Any]] = ()
) -> float:
    """Value of arithmetic of columns.

    Args:
        what: what error texts call it.
        text: the expression.
        row: column -> value.
        rows: those that `others` takes the mean of.

    Raises:
        ScenarioError: no expression, or a name that is no column.
    """

    def number(name: str, of: Mapping[str, Any]) -> float:
        if name not in of:
            raise ScenarioError(f"{what}: nothing is called {name!r}; {listing(of, name)}")
        try:
            return _number(of[name])
        except ValueError:
            raise ScenarioError(f"{what}: {name} is {of[name]!r}, not a number") from None

    def others(column: str, group: str) -> float:
        number(column, row)
        if group not in row:
            raise ScenarioError(f"{what}: nothing is called {group!r}; {listing(row, group)}")
        rest = [number(column, r) for r in rows if r is not row and r[group] == row[group]]
        if not rest:
            raise ScenarioError(f"{what}: no other row has {group} = {row[group]}")
        return sum(rest) / len(rest)

    def value(node: ast.AST) -> float:
        match node:
            case ast.Constant(value=int() | float() as constant):
                return float(constant)
            case ast.Name(id="pi"):
                return math.pi
            case ast.Name(id=name):
                return number(name, row)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return -value(operand)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
                return float(_BINARY[type(op)](value(left), value(right)))
            case ast.Call(func=ast.Name(id="others"), args=[ast.Name(id=a), ast.Name(id=b)]):
                return others(a, b)
            case ast.Call(func=ast.Name(id=name), args=args) if name in _FUNCTIONS:
                return float(_FUNCTIONS[name](*map(value, args)))
        raise ScenarioError(
            f"{what}: {ast.unparse(node)!r} is not understood; write arithmetic of columns, "
            f"{', '.join(_FUNCTIONS)}, pi and others(column, group)"
        )

    try:
        return value(ast.parse(text, mode="eval").body)
    except SyntaxError:
        raise ScenarioError(f"{what}: {text!r} is not an expression") from None
    except (ArithmeticError, ValueError, TypeError, RecursionError, MemoryError) as error:
        raise ScenarioError(f"{what}: {text!r} cannot be calculated ({error})") from None
