"""Columns that are moving means: told by what a fit leaves, which begins anew after each window."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .finding import Finding
from .smooth import ENOUGH

if TYPE_CHECKING:
    from ..estimate import Estimate

Vector = NDArray[np.float64]
ORDER = 3
"""Of the differences: of a line with a corner, which a mean rounds, two samples are left."""
FEWEST, MOST = ORDER, 100
"""Samples of a window that are looked for: more than differences of white noise are related by."""
FAR = 4.0
"""Deviations, by their median, from which a difference is no noise and does not count."""
OPPOSED = 0.35
"""Correlation, with the sign turned round, of differences that far apart: half in theory, less by
what else is in a residual; by chance one has a deviation of 0.07 (`ENOUGH`)."""
ALONE = 0.5
"""Share of it that those at any other distance may have, but one sample beside it."""


def check_averaged(estimate: Estimate) -> Iterator[Finding]:
    """Channels whose errors are those of a moving mean.

    Of white noise n, a mean over m samples steps by (n[k + m] - n[k]) / m from one sample to the
    next. Such steps, and their differences, have the correlation -1/2 if they are m samples apart;
    no filter without an end, motion, or law that a model lacks does that at one distance alone.
    Polynomials through windows (Savitzky-Golay) do as well. The motion is smoothed, too, which
    bends what bends and is no noise.
    """
    problem, found, count = estimate.problem, [], 0
    for index, channel in enumerate(problem.channels):
        columns = [values[:, index] for _, values in estimate.residuals]
        if channel.name in problem.source.made or not any(np.isfinite(c).any() for c in columns):
            continue
        count += 1
        if window := averaged(columns):
            text = (
                f"is smoothed over windows of {window} samples (a moving mean, a polynomial): what "
                "the fit leaves steps back after as many. The motion is smoothed, too, so that "
                "parameters are off by more than their intervals; take the raw column"
            )
            found.append((channel.name, text))
    for name, text in found:
        wrong = name in problem.source.instruments or len(found) == count
        yield Finding("error" if wrong else "warning", "smoothed", "", name, text)


def averaged(columns: Sequence[Vector]) -> int:
    """Samples of the window of a moving mean, 0 if columns are none.

    Args:
        columns: what is left of one channel in each run, nan in gaps.
    """
    sums, counts = np.zeros(MOST + 1), np.zeros(MOST + 1)
    for column in columns:
        steps = np.diff(column, ORDER)
        known = np.isfinite(steps)
        if int(known.sum()) <= ENOUGH:
            continue
        known &= np.abs(steps) < FAR / 0.6745 * np.median(np.abs(steps[known]))
        steps = np.where(known, steps, 0.0)
        for lag in range(min(MOST, steps.size - ENOUGH // 2) + 1):
            sums[lag] += steps[: steps.size - lag] @ steps[lag:]
            counts[lag] += known[: steps.size - lag] @ known[lag:].astype(np.float64)
    if counts[0] == 0.0:
        return 0
    related = sums / np.maximum(counts, 1.0)
    related = related[FEWEST:] / related[0]
    window = int(np.argmin(related))
    others = np.delete(related, [k for k in range(window - 1, window + 2) if 0 <= k < related.size])
    alone = np.max(np.abs(others)) < ALONE * abs(related[window])
    return window + FEWEST if related[window] < -OPPOSED and alone else 0
