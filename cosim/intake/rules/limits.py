"""Columns that stay at their largest or smallest value: a limit."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...calibrate.checks.finding import Finding
from ..clock import Clock
from ..topic import Topic

SHARE, LEAST = 0.01, 20
"""Of the samples, and number of samples, that must be at the extreme value."""
EDGE = 0.02
"""Share of the range next to the extreme value; of a sine, these 2 % hold a tenth of the
samples, and one step of resolution at the top far fewer."""
FINE = 500.0
"""Steps of resolution that the range must have; coarser columns stand at all their values."""


def check(topic: Topic, clock: Clock) -> Iterator[Finding]:
    """Columns of which more samples are at an extreme value than near it."""
    for name, values in topic.log.columns.items():
        good = values[np.isfinite(values)]
        if name == clock.column or good.size < LEAST:
            continue
        distinct = np.unique(good)
        if distinct.size < 50:
            continue
        span = float(distinct[-1] - distinct[0])
        if span < FINE * float(np.min(np.diff(distinct))):
            continue
        for extreme, what in ((distinct[-1], "largest"), (distinct[0], "smallest")):
            at = int(np.count_nonzero(good == extreme))
            near = int(np.count_nonzero(np.abs(good - extreme) <= EDGE * span)) - at
            if at >= max(LEAST, SHARE * good.size) and at > near:
                text = (
                    f"stays at its {what} value {extreme:.6g} in {at} of {good.size} samples: a "
                    "limit (saturation), or what it rests at"
                )
                yield Finding("note", "saturated", topic.name, name, text)
