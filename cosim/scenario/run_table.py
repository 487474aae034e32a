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
from .shape import TABLE

PLACE = re.compile(r"\{(\w+)\}")
_KEYS = {"file", "name", "join", "columns"}
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
        others = {row[on]: row for row in _rows(file) if on in row}
        lacking = [row.get(on) for row in rows if row.get(on) not in others]
        if lacking:
            raise ScenarioError(f"{file}: has no row with {on} = {lacking[0]}")
        rows = [{**others[row[on]], **row} for row in rows]
    for name, text in entry.get("columns", {}).items():
        values = [evaluate(f"{path}: column {name}", str(text), row, rows) for row in rows]
        for row, value in zip(rows, values, strict=True):
            row[name] = repr(value)
    return {str(fill(str(path), entry["name"], row)): row for row in rows}


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


def _value(text: str) -> Any:
    try:
        return float(text)
    except ValueError:
        return text


def fill(where: str, item: Any, row: Mapping[str, str]) -> Any:
    """A scenario's content with the row's values in the places of `{column}`.

    Raises:
        ScenarioError: the row has no such column.
    """
    if isinstance(item, list):
        return [fill(where, entry, row) for entry in item]
    if isinstance(item, dict):
        return {key: fill(where, entry, row) for key, entry in item.items()}
    if not isinstance(item, str):
        return item

    def of(match: re.Match[str]) -> str:
        if match[1] not in row:
            raise ScenarioError(f"{where}: nothing is called {match[0]}; {listing(row, match[1])}")
        return row[match[1]]

    filled = PLACE.sub(of, item)
    return _value(filled) if PLACE.fullmatch(item) else filled


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
            return float(of[name])
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
