"""Inputs that are known as means over the intervals between samples, and what they were within.

What was passed up to each sample is known exactly; a cubic spline through that, which bends least,

    minimize integral (theta'')^2    with theta(t_k) = sum of means times intervals,

gives the mean over each communication step. Held over a whole interval instead, a speed goes in
steps: dry friction slips behind each of them, and a vehicle that speeds up lags by a part of the
interval that no clock explains.

Not modelled: speeds that jump between two samples; a spline rings for two or three around them.

Source: de Boor, A Practical Guide to Splines (1978), ch. V (natural splines).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from ..data.signals import Table
from .counts import stretches

Vector = NDArray[np.float64]
FEW = 3
"""Intervals of a stretch; of fewer nothing is told but their means."""


class Parts(Table):
    """A table in which each sample of a column has become several values.

    Attributes:
        parts: how many, usually; their noise is one number.
    """

    parts: int = 1


def between(times: Vector, means: Vector, step: float) -> tuple[Vector, Vector, int]:
    """Times from which on values are held, these, and how many a sample usually becomes.

    They are the means themselves where a step is as long as an interval; where intervals are not
    equal (lost samples), means are held.

    Args:
        times: of the samples [s].
        means: over the interval that ends at each of them; the first is of no interval.
        step: communication step, into which intervals are divided [s].
    """
    if times.size < 2:
        return times, means, 1
    intervals = np.diff(times)
    parts = np.maximum(np.rint(intervals / step).astype(int), 1)
    passed = np.concatenate([[0.0], np.cumsum(means[1:] * intervals)])
    begins = [np.linspace(a, b, n, endpoint=False)
              for a, b, n in zip(times, times[1:], parts.tolist(), strict=False)]  # fmt: skip
    values = [np.full(n, mean) for mean, n in zip(means[1:], parts.tolist(), strict=True)]
    for first, last in stretches(times):
        if last - first < FEW or np.all(parts[first:last] == 1):
            continue
        way = CubicSpline(times[first : last + 1], passed[first : last + 1], bc_type="natural")
        for k in range(first, last):
            ends = np.append(begins[k], times[k + 1])
            values[k] = np.diff(way(ends)) / np.diff(ends)
    fine = np.append(np.concatenate(begins), times[-1])
    return fine, np.append(np.concatenate(values), means[-1]), int(np.median(parts))
