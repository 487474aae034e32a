"""Bursts of residuals, which count little in fits (`loss.Windowed`) and are named in the report.

Where casters turn over, the smallest difference decides when: a right model is off by tens of sigma
for some tenths of a second.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..calibrate.loss import WINDOW
from ..calibrate.parts import MeasuredRun
from .linear import SampleStack

Vector = NDArray[np.float64]
SUDDEN = 5.0
"""RMS over the noise in a window of a channel from which it is a burst; of noise alone, 20 samples
never reach 3."""


def bursts(residual: Vector, stack: SampleStack) -> dict[str, NDArray[np.bool_]]:
    """Run -> samples in windows with a burst in any channel, and in the windows beside them."""
    found = {}
    for run, values in zip(stack.runs, stack.by_run(residual), strict=True):
        sudden = np.zeros(len(values), dtype=np.bool_)
        for first in range(0, len(values), WINDOW):
            part = values[first : first + WINDOW]
            count = np.maximum(np.isfinite(part).sum(axis=0), 1)
            if np.any(np.nansum(part**2, axis=0) > SUDDEN**2 * count):
                sudden[max(first - WINDOW, 0) : first + 2 * WINDOW] = True
        if np.any(sudden):
            found[run.name] = sudden
    return found


def times(
    found: dict[str, NDArray[np.bool_]], runs: list[MeasuredRun]
) -> dict[str, list[tuple[float, float]]]:
    """First and last time of each burst, by run."""
    return {run.name: _spans(run.logged, found[run.name]) for run in runs if run.name in found}


def written(spans: list[tuple[float, float]]) -> str:
    """Stretches of time for people."""
    return ", ".join(f"{first:.2f} to {last:.2f} s" for first, last in spans)


def _spans(times: Vector, where: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """First and last time of each stretch."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(np.int8)))
    pairs = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return [(float(times[first]), float(times[last - 1])) for first, last in pairs]
