"""Single samples that stand out."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...calibrate.checks.finding import Finding
from ...calibrate.columns import spikes
from ..clock import Clock
from ..guess import turn_of
from ..topic import Topic


def check(topic: Topic, clock: Clock) -> Iterator[Finding]:
    """Columns with single samples that stand out from their neighbours (`columns.spikes`)."""
    for name, values in topic.log.columns.items():
        good = values[np.isfinite(values)]
        # of what stands still for half of the time, any change stands out
        if name == clock.column or good.size < 3 or turn_of(values)[0]:
            continue
        if np.median(np.abs(np.diff(good, 2))) == 0.0:
            continue
        at = np.flatnonzero(spikes(values))
        if at.size:
            sizes = [abs(values[k] - np.nanmedian(values[max(k - 2, 0) : k + 3])) for k in at]
            worst = int(at[int(np.argmax(sizes))])
            where = f"at {clock.times[worst]:.6g} s" if clock.times.size else f"in row {worst + 1}"
            text = (
                f"has {at.size} single samples that stand out, the largest {values[worst]:.6g} "
                f"{where}: despike = true makes gaps of them"
            )
            yield Finding("warning", "spikes", topic.name, name, text)
