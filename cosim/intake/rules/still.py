"""Columns that never change, or that change every few samples only."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...calibrate.checks.finding import Finding
from ...calibrate.checks.still import held
from ..clock import Clock
from ..topic import Topic


def check(topic: Topic, clock: Clock) -> Iterator[Finding]:
    """Constant columns, and such whose values stand for several samples each."""
    for name, values in topic.log.columns.items():
        good = values[np.isfinite(values)]
        if name == clock.column or good.size < 2:
            continue
        if np.ptp(good) == 0.0:
            yield Finding("note", "constant", topic.name, name, f"is {good[0]:g} throughout")
        elif period := held(good, float(np.std(good))):
            text = (
                f"changes every {period} samples only: a command that is held, a sensor that is "
                "slower than the clock, or values that were repeated"
            )
            yield Finding("note", "held", topic.name, name, text)
