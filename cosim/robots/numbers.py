"""Numbers in attributes of XML."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..errors import InputError


def finite(where: str, name: str, text: str) -> float:
    """One number.

    Raises:
        InputError: the text is none.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{where}: {name} is {text!r}; it must be a number")
    return value


def numbers(where: str, name: str, text: str, count: int) -> Any:
    """Several numbers, separated by blanks.

    Raises:
        InputError: the text is none, or has another count of them.
    """
    parts = text.split()
    if len(parts) != count:
        raise InputError(f"{where}: {name} is {text!r}; it must be {count} numbers")
    return np.array([finite(where, name, part) for part in parts])


def unit_vector(where: str, text: str) -> Any:
    """A direction of length 1.

    Raises:
        InputError: its length is 0.
    """
    vector = numbers(where, "axis", text, 3)
    length = float(np.linalg.norm(vector))
    if length == 0.0:
        raise InputError(f"{where}: its axis is {text!r}; an axis has a direction")
    return vector / length
