"""Cells without a number, and channels without a value."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from .finding import Finding

if TYPE_CHECKING:
    from ..problem import Problem

MANY = 0.5
"""Share of a channel's samples whose lack is worth a warning: what is slower than the clock lacks
many by itself."""


def check_gaps(problem: Problem) -> Iterator[Finding]:
    """What is lacking, counted; nothing here is of chance."""
    for index, channel in enumerate(problem.channels):
        values = np.concatenate([run.data[:, index] for run in problem.runs])
        if not np.isfinite(values).any():
            text = "has no values in any run"
            yield Finding("error", "empty", "", channel.name, text)
            continue
        for run in problem.runs:
            lost = int(np.count_nonzero(~np.isfinite(run.data[:, index])))
            if lost and lost > MANY * run.times.size:
                text = f"lacks {lost / run.times.size:.0%} of its samples"
                yield Finding("warning", "gaps", run.name, channel.name, text)
