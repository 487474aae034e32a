"""Columns that are another one, or a multiple of it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...calibrate.checks.finding import Finding
from ..clock import Clock
from ..topic import Topic

EXACT = 1e-9
"""Share of its spread by which a column may miss a multiple of another: rounding of doubles."""
LEAST, MOST = 20, 200
"""Samples that must be measured in both; columns of a topic above which nothing is compared."""


def check(topic: Topic, clock: Clock) -> Iterator[Finding]:
    """Pairs of columns of which one is a multiple of the other plus a constant."""
    items = [
        (name, values) for name, values in topic.log.columns.items()
        if name != clock.column and np.isfinite(values).sum() >= LEAST
        and np.nanmax(values) > np.nanmin(values)
    ]  # fmt: skip
    if len(items) > MOST:
        return
    for i, (name, values) in enumerate(items):
        for other, known in items[:i]:
            if known.shape != values.shape:
                continue
            good = np.isfinite(values) & np.isfinite(known)
            if good.sum() < LEAST or np.unique(known[good][:LEAST]).size < 3:
                continue
            a, b = values[good], known[good]
            spread = float(np.var(b))
            gain = float(np.mean((a - a.mean()) * (b - b.mean()))) / spread if spread else 0.0
            offset = float(a.mean() - gain * b.mean())
            if gain and np.max(np.abs(a - gain * b - offset)) < EXACT * np.ptp(a):
                same = abs(gain - 1.0) < EXACT and abs(offset) < EXACT * np.ptp(a)
                plus = f" plus {offset:.4g}" if abs(offset) > EXACT * np.ptp(a) else ""
                how = f"a copy of {other}" if same else f"{gain:.6g} times {other}{plus}"
                yield Finding("note", "copy", topic.name, name, f"is {how}")
                break
