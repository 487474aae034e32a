"""Signals in a page: every sample where there is room, smallest and largest of stretches if not."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .html import Html

Vector = NDArray[np.float64]
LEAST = 200
"""Stretches of a signal that are kept at least: about what a small screen can show."""
PER_VALUE = 8.0 / 3.0
"""Characters for a number: two bytes in base64."""
LEVELS = 65534
"""Steps between the smallest and the largest value of a signal."""
EVEN = 1e-3
"""Part of an interval by which times of an even grid may be off it: logs keep them rounded, often
to 32 bits, and no screen shows it."""


def stretch(samples: int, room: float, longest: int) -> int:
    """How many samples are drawn as one, by their smallest and largest value.

    Args:
        samples: of all signals together.
        room: characters that they may take.
        longest: samples of the longest signal.
    """
    if samples * PER_VALUE <= room:
        return 1
    size = math.ceil(2.0 * samples * PER_VALUE / max(room, 1.0))
    return max(min(size, longest // LEAST), 2)


def envelope(values: Vector, size: int) -> tuple[Vector, Vector]:
    """Smallest and largest finite value of stretches of samples; NaN where there is none."""
    whole = -(-values.size // size)
    padded = np.full(whole * size, np.nan)
    padded[: values.size] = values
    parts = padded.reshape(whole, size)
    empty = ~np.isfinite(parts).any(axis=1)
    low = np.where(np.isfinite(parts), parts, np.inf).min(axis=1)
    high = np.where(np.isfinite(parts), parts, -np.inf).max(axis=1)
    low[empty] = high[empty] = np.nan
    return low, high


def packed(values: Vector, rounding: Callable[[Vector], Vector] = np.rint) -> dict[str, Any]:
    """Numbers as 16 bits each, in base64; gaps stay gaps.

    Args:
        values: to be packed.
        rounding: to one of the levels: `numpy.floor` for smallest values, `numpy.ceil` for largest.
    """
    good = np.isfinite(values)
    low = float(values[good].min()) if good.any() else 0.0
    step = (float(values[good].max()) - low) / LEVELS if good.any() else 0.0
    step = step or 1.0
    levels = np.full(values.size, -32768.0)
    levels[good] = np.clip(rounding((values[good] - low) / step), 0, LEVELS) - 32767.0
    data = base64.b64encode(levels.astype("<i2").tobytes()).decode("ascii")
    return {"low": low, "step": step, "data": data}


def axis(times: Vector) -> Any:
    """An axis: first value, step and count where it is even."""
    if times.size > 2:
        step = float(times[-1] - times[0]) / (times.size - 1)
        even = times[0] + step * np.arange(times.size)
        if step > 0.0 and float(np.max(np.abs(times - even))) <= EVEN * step:
            return {"first": float(times[0]), "step": step, "count": int(times.size)}
    return [float(f"{value:.10g}") for value in times]


class Store:
    """The signals of a page by name, and how much they were thinned."""

    def __init__(self) -> None:
        self.content: dict[str, Any] = {}

    def put_axis(self, name: str, times: Vector, size: int = 1) -> None:
        """An axis; of each stretch the middle."""
        if size > 1:
            starts = np.arange(0, times.size, size)
            ends = np.minimum(starts + size, times.size) - 1
            times = 0.5 * (times[starts] + times[ends])
        self.content[name] = axis(times)

    def put(self, name: str, values: Vector, size: int = 1) -> None:
        """A signal; where it is thinned, `name` is its smallest and `name^` its largest values."""
        if size <= 1:
            self.content[name] = packed(values)
            return
        low, high = envelope(values, size)
        self.content[name] = packed(low, np.floor)
        self.content[f"{name}^"] = packed(high, np.ceil)

    @property
    def html(self) -> Html:
        """For the page's script."""
        return script_data(self.content, "signal-data")


def script_data(content: Any, name: str = "") -> Html:
    """JSON that a script of the page reads."""
    written = json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return Html(
        f'<script type="application/json"{f" id={name!r}" if name else ""}>{written}</script>'
    )
