"""Kinds of the arguments of public calls: one of another kind is named, with the way out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from numbers import Integral, Real
from typing import Any

from .errors import InputError
from .reading.schema import shown


def wrong(what: str, value: Any, wanted: str, way: str = "") -> InputError:
    """The error for an argument of another kind."""
    return InputError(
        f"{what} must be {wanted}, not {shown(value)} (a {type(value).__name__})"
        + (f"; {way}" if way else "")
    )


def is_number(value: Any) -> bool:
    """Whether it is a real number (truth values are none)."""
    return isinstance(value, Real) and not isinstance(value, bool)


def need_number(what: str, value: Any, way: str = "") -> None:
    """Refuse what is not a real number."""
    if not is_number(value):
        raise wrong(what, value, "a number", way)


def need_whole(what: str, value: Any) -> None:
    """Refuse what is not a whole number."""
    if not isinstance(value, Integral) or isinstance(value, bool):
        raise wrong(what, value, "a whole number")


def need_text(what: str, value: Any, way: str = "") -> None:
    """Refuse what is not a text."""
    if not isinstance(value, str):
        raise wrong(what, value, "a text", way)


def need_table(what: str, value: Any, example: str) -> None:
    """Refuse what is not a table of names."""
    if not isinstance(value, Mapping):
        raise wrong(what, value, "a table", f"write {example}")
    for key in value:
        need_text(f"a name in {what}", key, f"write {example}")


def need_texts(what: str, value: Any, example: str) -> None:
    """Refuse what is not several texts; one text alone is none: its letters would be taken."""
    if isinstance(value, (str, bytes)) or not isinstance(value, Iterable):
        raise wrong(what, value, "a list of names", f"write {example}")
    for item in value:
        need_text(f"each name of {what}", item, f"write {example}")


def need_function(what: str, value: Any) -> None:
    """Refuse what cannot be called."""
    if value is not None and not callable(value):
        raise wrong(what, value, "a function")
