"""Options of the form NAME=VALUE."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from ..errors import InputError


def pairs(given: Sequence[str] | None, option: str, form: str) -> dict[str, str]:
    """Name -> text of an option that may be given several times.

    Raises:
        InputError: one is not of the form.
    """
    found = {}
    for text in given or ():
        key, equals, value = text.partition("=")
        if not equals or not key or not value:
            raise InputError(f"{option} {text}: write {option} {form}")
        found[key.strip()] = value.strip()
    return found


def values(given: Sequence[str] | None, option: str, form: str) -> dict[str, Any]:
    """Name -> number, list or text; as `pairs`."""
    return {key: _number(text) for key, text in pairs(given, option, form).items()}


def _number(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        try:
            return float(text)
        except ValueError:
            return text
