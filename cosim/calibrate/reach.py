"""Samples that late clocks move out of a run: nobody knows what should be compared there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from .parts import COINCIDENT, DRIFT, Channel, MeasuredRun

Vector = NDArray[np.float64]


def known(
    run: MeasuredRun, channels: Sequence[Channel], errors: Mapping[str, float], read: Vector
) -> Vector:
    """What channels would read, NaN where clocks have moved what was measured out of the run.

    Args:
        run: measured.
        channels: of its columns.
        errors: of the log, see `Problem.log_errors`.
        read: one column per channel.
    """
    times, read = run.times, read.copy()
    close = COINCIDENT * run.interval
    begin = float(times[0]) - run.lead - close
    end = float(times[-1]) - max([0.0, *(errors.get(name, 0.0) for name in run.inputs)]) + close
    for index, channel in enumerate(channels):
        wanted = times - errors.get(channel.name, 0.0)
        wanted = wanted - errors.get(DRIFT + channel.name, 0.0) * (times - times[0])
        out = (wanted < begin) | (wanted > end)
        read[out & np.isfinite(run.data[:, index]), index] = np.nan
    return read


def apart(run: MeasuredRun, read: Vector, sigma: Vector) -> Vector:
    """(measured - read) / sigma of a run, as noise where it is not known what would be read.

    A sample that is a sigma off to either side in turn is worth neither more nor less than one
    that is explained; one that is left out would be worth half a nat.
    """
    found = np.asarray((run.data - read) / sigma, dtype=np.float64)
    gaps = np.isnan(read)
    if gaps.any() and np.any(out := gaps & np.isfinite(run.data)):
        side = np.where(np.arange(run.times.size) % 2 == 0, 1.0, -1.0)
        found[out] = np.broadcast_to(side[:, None], found.shape)[out]
    return found
