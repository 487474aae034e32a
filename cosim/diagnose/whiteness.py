"""Does a residual hold more than white noise? Size, slow parts, correlation, by channel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from ..calibrate.loss import WINDOW
from .linear import MATERIAL, SampleStack

Vector = NDArray[np.float64]
BURST = 0.01
"""Share of the windows, those with the largest residuals, that do not count where start values
decide when something turns over (`Problem.late`): for some tenths of a second a model that is right
is off by tens of sigma there. What lasts no longer in all runs together is no ground to look for a
cause. Elsewhere a right model has no such moments, and a wrong one may be wrong in few."""
CALIBRATED = 1.1
"""RMS over noise up to which a model counts as calibrated: the sheets give noise to a few percent,
and thousands of samples make any smaller excess significant without making it worth a cause."""
UNNAMED = float(np.sqrt(1.0 + WINDOW * MATERIAL**2))
"""Slow parts over noise's, as much as laws that are too small for a name can leave: one that adds
`MATERIAL` to a channel, and keeps its sign over windows. Right models of the laboratory's and of
generated rigs leave 1.11 at most; a wrong law that was chosen for a marker's place, 1.4 to 2.1,
within 1.1 of the noise by size."""


@dataclass(frozen=True)
class WhitenessTest:
    """Test of one channel in some runs.

    Attributes:
        channel: its name.
        rms: over the noise.
        lasting: the same without the worst windows, where runs may have such (see `BURST`).
        slow: RMS of sums over windows, over what white residuals of the given noise give, the worst
            windows left out.
        correlation: of neighbouring samples.
        freedom: effective number of independent residuals.
        p_value: that noise alone has such slow parts, the worst windows left out.
    """

    channel: str
    rms: float
    lasting: float
    slow: float
    correlation: float
    freedom: float
    p_value: float

    @property
    def structured(self) -> bool:
        """More than noise, and enough to look for a cause."""
        return structured(self.lasting, self.p_value)

    def to_dict(self) -> dict[str, float | bool | str]:
        """As in the JSON."""
        return {
            "channel": self.channel, "rms_over_noise": self.rms,
            "lasting_over_noise": self.lasting, "slow_over_noise": self.slow,
            "correlation": self.correlation, "effective_samples": self.freedom,
            "p_value": self.p_value, "structured": self.structured,
        }  # fmt: skip


def structured(lasting: float, p_value: float) -> bool:
    """Whether a channel holds more than noise, and enough to look for a cause.

    Args:
        lasting: RMS over noise without the worst windows.
        p_value: that noise alone has such slow parts.
    """
    return p_value < 0.01 and lasting > CALIBRATED


def slowly(slow: float, p_value: float, tests: int) -> bool:
    """Whether slow parts are more than laws leave that are too small for a name.

    Args:
        slow: over what noise has.
        p_value: that noise alone has such slow parts.
        tests: as many were made, of which one is the worst (Bonferroni).
    """
    return slow > UNNAMED and tests * p_value < 0.01


def whiteness_tests(residual: Vector, stack: SampleStack) -> list[WhitenessTest]:
    """Test each channel over all runs of a stack."""
    rows = stack.by_run(residual)
    share = BURST if stack.problem.late else 0.0
    found = []
    for column, channel in enumerate(stack.problem.channels):
        squares, products, pairs, count = 0.0, 0.0, 0, 0
        windows = np.empty((0, WINDOW))
        for values in rows:
            one = values[:, column]
            one = one[np.isfinite(one)]
            squares += float(one @ one)
            count += one.size
            products += float(one[1:] @ one[:-1])
            pairs += max(one.size - 1, 0)
            whole = one.size // WINDOW * WINDOW
            windows = np.concatenate([windows, one[:whole].reshape(-1, WINDOW)])
        if not count:
            continue
        variance = squares / count
        correlation = products / max(pairs, 1) / max(variance, 1e-300)
        sums = np.square(windows.sum(axis=1)) / WINDOW
        every = float(np.mean(sums)) if sums.size else variance
        freedom = count * min(variance / max(every, 1e-300), 1.0)
        sizes = np.mean(np.square(windows), axis=1)
        kept = np.argsort(sizes)[: sizes.size - int(share * sizes.size)]
        slow = float(np.mean(sums[kept])) if sums.size else variance
        lasting = float(np.mean(sizes[kept])) if sizes.size else variance
        p_value = float(chdtrc(kept.size, np.sum(sums[kept]))) if sums.size else 1.0
        found.append(
            WhitenessTest(channel.name, float(np.sqrt(variance)), float(np.sqrt(lasting)),
                      float(np.sqrt(slow)), float(correlation), freedom, p_value)
        )  # fmt: skip
    return found
