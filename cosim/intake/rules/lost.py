"""Zeros that a sensor writes while it has lost what it looks at."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ...calibrate.checks.finding import Finding
from ..clock import Clock
from ..topic import Topic

JUMP = 10.0
"""Usual steps of a column that are a jump: no machine makes two of them in several columns at the
same samples, from where it is to 0 and back."""
TOGETHER = 2
"""Columns that must do so at once: one that reads 0 for a while may stand there."""


def check(topic: Topic, clock: Clock) -> Iterator[Finding]:
    """Columns that are 0 together between other values, and jump there and back."""
    found = lost(topic, clock.column)
    for name, where in found.items():
        others = ", ".join(other for other in found if other != name)
        first = int(np.flatnonzero(where)[0])
        place = f"from {clock.times[first]:.6g} s" if clock.times.size else f"from row {first + 1}"
        text = (
            f"is exactly 0 in {int(where.sum())} rows, {place} on, together with {others}, and "
            "jumps there and back: what a sensor writes that has lost its object; missing = 0 in "
            "[columns] makes gaps of them"
        )
        yield Finding("warning", "gaps", topic.name, name, text)


def lost(topic: Topic, clock: str) -> dict[str, NDArray[np.bool_]]:
    """Rows of columns in which 0 means that nothing was measured, by column."""
    jumps = {
        name: mask for name, values in topic.log.columns.items()
        if name != clock and (mask := _gone(values)).any()
    }  # fmt: skip
    if len(jumps) < TOGETHER:
        return {}
    shared = np.sum(list(jumps.values()), axis=0) >= TOGETHER
    return {name: both for name, mask in jumps.items() if (both := mask & shared).any()}


def _gone(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Rows of 0 that a column jumps to from both sides."""
    zero, gone = values == 0.0, np.zeros(values.size, dtype=bool)
    good = np.isfinite(values) & ~zero
    steps = np.abs(np.diff(values[good]))
    # what stands still for half of the time, or is ordered in steps, jumps by itself
    usual = float(np.median(steps)) if steps.size else 0.0
    if usual == 0.0 or not zero.any():
        return gone
    edges = np.flatnonzero(np.diff(np.concatenate([[0], zero.view(np.int8), [0]])))
    for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        before, after = values[first - 1 : first], values[last : last + 1]
        ends = np.abs(np.concatenate([before, after]))
        if ends.size == 2 and np.all(ends > JUMP * usual):
            gone[first:last] = True
    return gone
