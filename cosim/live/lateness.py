"""How late results are: quantiles of many durations in little memory."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

FIRST, DECADES, PARTS = 1e-6, 9, 100
"""From a microsecond to a quarter of an hour; a hundred bins per decade are 2.3 % apart."""


class Lateness:
    """A histogram of durations with bins of equal ratio."""

    def __init__(self) -> None:
        self._bins = np.zeros(DECADES * PARTS + 1, dtype=np.int64)
        self._most = 0.0

    def add(self, seconds: float, times: int = 1) -> None:
        """Note a duration."""
        place = PARTS * math.log10(max(seconds, FIRST) / FIRST)
        self._bins[min(int(place), len(self._bins) - 1)] += times
        self._most = max(self._most, seconds)

    def quantile(self, part: float) -> float:
        """The duration that this part of all does not exceed [s], to 2.3 %."""
        reached = np.searchsorted(np.cumsum(self._bins), part * self._bins.sum())
        return float(min(FIRST * 10.0 ** ((int(reached) + 1) / PARTS), self._most))

    def to_dict(self) -> dict[str, Any] | None:
        """Median, 99 % and largest [s]; None if there was nothing."""
        if not self._bins.any():
            return None
        values = {"median": self.quantile(0.5), "p99": self.quantile(0.99), "max": self._most}
        return {key: float(f"{value:.3g}") for key, value in values.items()}
