"""Does a residual hold more than noise? Size, slow parts and correlation, by channel and run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from .linear import Layout

Vector = NDArray[np.float64]
WINDOW = 20
"""Samples that are summed: noise adds up like their root, structure like their number."""
MATERIAL = 1.1
"""RMS over noise up to which a model counts as calibrated: the sheets give noise to a few percent,
and thousands of samples make any smaller excess significant without making it worth a cause."""


@dataclass(frozen=True)
class Structure:
    """Test of one channel in some runs.

    Attributes:
        channel: its name.
        rms: over the noise.
        slow: RMS of sums over windows, over what white residuals of the given noise give.
        correlation: of neighbouring samples.
        freedom: effective number of independent residuals.
        p_value: that noise alone has such slow parts.
    """

    channel: str
    rms: float
    slow: float
    correlation: float
    freedom: float
    p_value: float

    @property
    def structured(self) -> bool:
        """More than noise, and enough to look for a cause."""
        return self.p_value < 0.01 and self.rms > MATERIAL

    def to_dict(self) -> dict[str, float | bool | str]:
        """As in the JSON."""
        return {
            "channel": self.channel, "rms_over_noise": self.rms, "slow_over_noise": self.slow,
            "correlation": self.correlation, "effective_samples": self.freedom,
            "p_value": self.p_value, "structured": self.structured,
        }  # fmt: skip


def structures(residual: Vector, layout: Layout) -> list[Structure]:
    """Test each channel over all runs of a layout."""
    rows = layout.by_run(residual)
    found = []
    for column, channel in enumerate(layout.problem.channels):
        squares, sums, products, pairs, count = 0.0, [0.0], 0.0, 0, 0
        for values in rows:
            one = values[:, column]
            one = one[np.isfinite(one)]
            squares += float(one @ one)
            count += one.size
            products += float(one[1:] @ one[:-1])
            pairs += max(one.size - 1, 0)
            whole = one.size // WINDOW * WINDOW
            sums += (one[:whole].reshape(-1, WINDOW).sum(axis=1) / np.sqrt(WINDOW)).tolist()
        if not count:
            continue
        sums = sums[1:]
        variance = squares / count
        correlation = products / max(pairs, 1) / max(variance, 1e-300)
        slow = float(np.mean(np.square(sums))) if sums else variance
        freedom = count * min(variance / max(slow, 1e-300), 1.0)
        total = float(np.sum(np.square(sums)))
        p_value = float(chi2.sf(total, max(len(sums), 1))) if sums else 1.0
        found.append(
            Structure(channel.name, float(np.sqrt(variance)), float(np.sqrt(slow)),
                      float(correlation), freedom, p_value)
        )  # fmt: skip
    return found
