"""Kinds of the values in files of tables (TOML): what is of another is named with its place."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from ..errors import ScenarioError

Check = Callable[[Any, str], None]
"""Takes a value and its place for the error text; raises ScenarioError."""
DEPTH = 40
"""Tables within tables; ours need five."""
_LONGEST = 60
"""Characters of a value that are shown."""


def fail(where: str, value: Any, wanted: str) -> ScenarioError:
    """The error for a value of another kind."""
    return ScenarioError(f"{where} must be {wanted}, not {shown(value)}")


def shown(value: Any) -> str:
    """A value in an error text, cut where it is long."""
    try:
        whole = repr(value)
    except ValueError:  # Python writes no whole numbers of more than 4300 digits
        return "a number of thousands of digits"
    return whole if len(whole) <= _LONGEST else whole[:_LONGEST] + " …"


def text(value: Any, where: str) -> None:
    """A text."""
    if not isinstance(value, str):
        raise fail(where, value, "a text in quotes")


def path(value: Any, where: str) -> None:
    """A text that a file can have as its name."""
    text(value, where)
    if "\0" in value or not value:
        raise fail(where, value, "the path of a file")


def number(value: Any, where: str) -> None:
    """A finite number."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise fail(where, value, "a number")
    try:
        finite = math.isfinite(value)
    except OverflowError:  # a whole number beyond floating point
        finite = False
    if not finite:
        raise fail(where, value, "a finite number")


def floating(value: Any, where: str) -> None:
    """A number, infinity or not a number (a gap)."""
    if not isinstance(value, float):
        number(value, where)


def flag(value: Any, where: str) -> None:
    """True or false."""
    if not isinstance(value, bool):
        raise fail(where, value, "true or false")


def table(value: Any, where: str) -> None:
    """A table."""
    if not isinstance(value, Mapping):
        raise fail(where, value, "a table")


def anything(value: Any, where: str) -> None:
    """Whatever it is, it is checked elsewhere."""


def either(wanted: str, *checks: Check) -> Check:
    """What one of some checks takes; `wanted` says what that is."""

    def check(value: Any, where: str) -> None:
        for one in checks:
            try:
                return one(value, where)
            except ScenarioError:
                continue
        raise fail(where, value, wanted)

    return check


def list_of(check: Check, size: int | None = None) -> Check:
    """A list of values, of so many where the size is given."""

    def checked(value: Any, where: str) -> None:
        if not isinstance(value, list) or (size is not None and len(value) != size):
            raise fail(where, value, "a list" if size is None else f"a list of {size}")
        for index, item in enumerate(value, 1):
            check(item, f"{where}, entry {index},")

    return checked


def table_of(check: Check) -> Check:
    """A table of any names, all of whose values are of one kind."""

    def checked(value: Any, where: str) -> None:
        table(value, where)
        for name, item in value.items():
            check(item, f"{where} {name}")

    return checked


def keyed(checks: Mapping[str, Check]) -> Check:
    """A table whose known keys have values of their kinds; unknown keys are left to others."""

    def checked(value: Any, where: str) -> None:
        table(value, where)
        for key, check in checks.items():
            if key in value:
                check(value[key], f"{where}: {key}")

    return checked


said = either("a text or a number", text, number)
"""What may also be a number where a row of a table gave it."""
texts = list_of(text)
"""A list of texts."""


def depth_of(value: Any) -> int:
    """How deep tables and lists lie within each other."""
    deepest, rest = 0, [(value, 1)]
    while rest:
        item, depth = rest.pop()
        if isinstance(item, (Mapping, list)):
            deepest = max(deepest, depth)
            inner = item.values() if isinstance(item, Mapping) else item
            rest += [(one, depth + 1) for one in inner]
    return deepest
