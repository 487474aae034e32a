"""Does a residual hold more than white noise? Size, slow parts, correlation, by channel.

Runs are cut into windows of like length, as near to `WINDOW` samples as goes. Slow parts are sums
s_w over the n_w samples of a window, fast ones the products of samples up to `NEAR` apart in one:

    sum of s_w^2 / n_w,   sum over k of c_k^2 / (N_k v^2),   c_k = sum of r_i r_(i+k)

with N_k pairs and the mean square v of the residual itself: chi-square with as many degrees of
freedom as there are windows and distances, of white noise of the stated size and of any size. The
second sees a hum of whole periods per window, of which the first sees nothing. The first over v is
chi-square of white noise of any size, too: where neither says more than size, no law does, since
forces last and vibrate.

Source: Box and Pierce, Distribution of residual autocorrelations in autoregressive-integrated
moving average time series models, 1970.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from ..calibrate.loss import WINDOW
from .linear import MATERIAL, SampleStack

Vector = NDArray[np.float64]
NEAR = WINDOW // 2
"""Samples up to which neighbours are compared: those in half of a window's pairs."""
BURST = 0.01
"""Share of the windows, those with the largest residuals, that do not count where start values
decide when something turns over (`Problem.late`): for some tenths of a second a model that is right
is off by tens of sigma there. What lasts no longer in all runs together is no ground to look for a
cause. Elsewhere a right model has no such moments, and a wrong one may be wrong in few."""
RARE = 0.01
"""Probability below which it was not noise."""
CALIBRATED = 1.1
"""RMS over noise up to which a model counts as calibrated: the sheets give noise to a few percent,
and thousands of samples make any smaller excess significant without making it worth a cause."""
STATED = 2.0
"""What noise may be over its figure where it is white. Figures that are guessed are good to this;
of more, a vibration that passes faster than it is sampled, which looks white, is as likely."""
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
        p_fast: that white noise of any size has neighbours so alike, likewise.
        p_white: that white noise of any size has such slow parts, likewise.
    """

    channel: str
    rms: float
    lasting: float
    slow: float
    correlation: float
    freedom: float
    p_value: float
    p_fast: float
    p_white: float

    @property
    def white(self) -> bool:
        """Whether samples do not know of each other, though they may be larger than stated."""
        return white(self.lasting, self.p_fast, self.p_white)

    @property
    def structured(self) -> bool:
        """More than noise, and enough to look for a cause."""
        return structured(self.lasting, self.p_value, self.p_fast)

    def to_dict(self) -> dict[str, float | bool | str]:
        """As in the JSON."""
        return {
            "channel": self.channel, "rms_over_noise": self.rms,
            "lasting_over_noise": self.lasting, "slow_over_noise": self.slow,
            "correlation": self.correlation, "effective_samples": self.freedom,
            "p_value": self.p_value, "p_fast": self.p_fast, "p_white": self.p_white,
            "structured": self.structured,
        }  # fmt: skip


def structured(lasting: float, *p_values: float) -> bool:
    """Whether a channel holds more than noise, and enough to look for a cause.

    Args:
        lasting: RMS over noise without the worst windows.
        p_values: that noise alone has such slow parts, or such fast ones.
    """
    return min(p_values) < RARE and lasting > CALIBRATED


def white(lasting: float, *p_values: float) -> bool:
    """Whether a residual is white noise, of the stated size or up to `STATED` times that.

    Args:
        lasting: RMS over noise without the worst windows.
        p_values: that white noise of any size has such slow parts, and such fast ones.
    """
    return lasting < STATED and min(p_values) >= RARE


def slowly(slow: float, p_value: float, tests: int) -> bool:
    """Whether slow parts are more than laws leave that are too small for a name.

    Args:
        slow: over what noise has.
        p_value: that noise alone has such slow parts.
        tests: as many were made, of which one is the worst (Bonferroni).
    """
    return slow > UNNAMED and tests * p_value < RARE


def whiteness_tests(residual: Vector, stack: SampleStack) -> list[WhitenessTest]:
    """Test each channel over all runs of a stack."""
    rows = stack.by_run(residual)
    share = BURST if stack.problem.late else 0.0
    found = []
    for column, channel in enumerate(stack.problem.channels):
        parts = [one[np.isfinite(one)] for one in (values[:, column] for values in rows)]
        counts = np.array([part.size for part in parts])
        one, count = np.concatenate(parts), int(counts.sum())
        if not count:
            continue
        products = sum(float(part[1:] @ part[:-1]) for part in parts)
        pairs = int(np.sum(np.maximum(counts - 1, 0)))
        variance = float(one @ one) / count
        correlation = products / max(pairs, 1) / max(variance, 1e-300)
        lengths = np.concatenate([_windows(size) for size in counts.tolist()])
        begins = np.cumsum(lengths) - lengths
        sums = np.square(np.add.reduceat(one, begins)) / lengths
        squares = np.add.reduceat(np.square(one), begins)
        freedom = count * min(variance / max(float(np.mean(sums)), 1e-300), 1.0)
        kept = np.argsort(squares / lengths)[: lengths.size - int(share * lengths.size)]
        lasting = float(np.sum(squares[kept]) / np.sum(lengths[kept]))
        slow = float(np.mean(sums[kept]))
        numbers = np.repeat(np.arange(lengths.size), lengths)
        numbers[~np.isin(numbers, kept)] = -1
        found.append(
            WhitenessTest(
                channel.name, float(np.sqrt(variance)), float(np.sqrt(lasting)),
                float(np.sqrt(slow)), float(correlation), freedom,
                float(chdtrc(kept.size, np.sum(sums[kept]))), _fast(one, numbers, lasting),
                float(chdtrc(kept.size, np.sum(sums[kept]) / max(lasting, 1e-300))),
            )
        )  # fmt: skip
    return found


def _windows(size: int) -> NDArray[np.int64]:
    """Lengths of the windows of a run with so many samples, which differ by one at most."""
    count = max(round(size / WINDOW), 1) if size else 0
    return np.array([len(part) for part in np.array_split(np.empty(size), count or 1)][:count],
                    dtype=np.int64)  # fmt: skip


def _fast(one: Vector, numbers: NDArray[np.int64], variance: float) -> float:
    """P value of the products of neighbours in a window; windows of number -1 do not count."""
    total, distances = 0.0, 0
    for k in range(1, NEAR + 1):
        near = (numbers[k:] == numbers[:-k]) & (numbers[k:] >= 0)
        if pairs := int(near.sum()):
            total += float(np.sum(one[k:][near] * one[:-k][near])) ** 2 / pairs
            distances += 1
    if not distances or variance == 0.0:
        return 1.0
    return float(chdtrc(distances, total / variance**2))
