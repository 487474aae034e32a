"""Kinds of the values of a scenario (docs/scenarios.md has the meanings)."""

from __future__ import annotations

from typing import Any

from ..reading.schema import (
    Check,
    anything,
    either,
    flag,
    floating,
    keyed,
    list_of,
    number,
    path,
    said,
    table,
    table_of,
    text,
    texts,
)

_LIST: Check = list_of(anything)
OUTSIDE: dict[str, Check] = {
    "variants": table, "parameters": table, "inputs": table, "compare": table, "record": table,
    "options": table, "checks": list_of(table), "plots": list_of(table), "plot": _LIST,
    "figures": list_of(table),
    "table": table, "runs": table_of(table),
}  # fmt: skip
"""Before rows of a table are filled in, which may stand for texts and numbers."""
_VALUE = either("a number, a text or a truth value", number, text, flag)
_VALUES = list_of(
    either("a number, a text, a truth value or a row of such", _VALUE, list_of(_VALUE))
)
_SOURCE: dict[str, Check] = {
    "file": path, "data": path, "run": said, "column": said, "columns": list_of(said),
    "time": said, "unit": said, "constant": either("a value or a list of values", _VALUE, _VALUES),
    "times": list_of(floating), "values": list_of(_VALUE),
    "interpolation": text,
}  # fmt: skip
_POINT = list_of(number, 2)
_COMPARED: dict[str, Check] = {
    **_SOURCE, "signal": text, "signals": texts, "offset": said, "scale": number, "name": said,
    "constant": number,
    "circle": keyed({"start": _POINT, "centre": _POINT, "rate": number}),
}  # fmt: skip
_CHECK: dict[str, Check] = {
    "name": said, "source": said, "of": text, "signal": text, "signals": texts,
    "comparison": text, "minus": text, "quantity": said, "case": said, "reference": said,
    "after": floating, "before": floating, "expected": number, "per": number, "relative": flag,
    "limit": either("a number, or two", floating, list_of(floating, 2)),
    "holds_for": table_of(either("a variant or a list of variants", text, texts)),
}  # fmt: skip
_AXES: dict[str, Check] = {
    "label": said, "signals": texts, "paths": list_of(list_of(text, 2)), "comparisons": texts,
    "names": list_of(said), "unit": said, "minus": text, "after": floating, "before": floating,
    "error_unit": said,
}  # fmt: skip
_FIGURE: dict[str, Check] = {
    "name": text, "title": said, "runs": texts, "together": flag, "columns": number,
    "errors": flag, "plots": list_of(keyed(_AXES)), "quantities": texts,
}  # fmt: skip
INSIDE: dict[str, Check] = {
    "description": said, "question": said, "expected": said, "source": said, "system": path,
    "duration": number, "start": number, "step": number, "tolerance": number, "algorithm": text,
    "variants": table_of(text), "parameters": table, "options": table,
    "inputs": table_of(
        either("a value, a list of values or a table", _VALUE, _VALUES, table)
    ),
    "compare": table_of(table), "record": keyed({"signals": texts, "period": number}),
    "checks": list_of(keyed(_CHECK)), "plots": list_of(keyed(_AXES)), "plot": texts,
    "figures": list_of(keyed(_FIGURE)),
}  # fmt: skip
"""Of one run, rows filled in."""
TABLE: dict[str, Check] = {
    "file": path, "name": text, "join": keyed({"file": path, "on": text}),
    "columns": table_of(said),
}  # fmt: skip
"""Of `[table]`."""
_TEXTUAL = (text, path, said, texts)
TEXTS = frozenset(
    key
    for kinds in (_SOURCE, _COMPARED, _CHECK, _AXES, _FIGURE, INSIDE)
    for key, kind in kinds.items()
    if kind in _TEXTUAL
) - {"offset", "expected"} | {"columns", "names"}
"""Keys whose values are texts, also where they look like numbers: the column `1`, the run `007`. An
offset is either."""
check_source = keyed(_SOURCE)
check_compared = keyed(_COMPARED)


def check_outside(content: Any, where: str) -> None:
    """Check a scenario as read, or the changes of a run."""
    keyed(OUTSIDE)(content, where)


def check_inside(content: Any, where: str) -> None:
    """Check one run, rows filled in."""
    if "system" not in content or not isinstance(content["system"], str):
        content = {key: value for key, value in content.items() if key != "system"}
    keyed(INSIDE)(content, where)
    for name, entry in content.get("inputs", {}).items():
        if isinstance(entry, dict):
            check_source(entry, f"{where}: input {name}")
    for name, entry in content.get("compare", {}).items():
        check_compared(entry, f"{where}: compare {name}")
