"""Alarms on residuals whose false-alarm rate follows from the noise, and from nothing else.

Residuals over their sigma are cut into windows of 8, 16, 32, ... samples, which do not overlap at
one length. In each window of each channel two numbers are tested against white noise of variance 1:

    mean     z = sum(r) / sqrt(n)      normal           small errors that last
    energy   q = sum(r^2)              chi-square(n)    errors that come and go

An alarm is a probability below a threshold. Its expected number under noise is the sum of the
thresholds over all tests, whatever tests depend on each other; the thresholds share the stated rate
evenly over the lengths. Long windows find weak effects late, short ones strong effects at once.

What this assumes: the noise is white, Gaussian, of the data set's sigma. What the model is off by
without a fault, since calibrated values have errors of their own, is told by `margin`: it must
exceed neither the mean nor the root mean square of that in any window, in sigmas. Then z counts
less margin sqrt(n), q is noncentral chi-square(n, n margin^2), and false alarms come no oftener.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, erfc

Vector = NDArray[np.float64]
FIRST = 8
"""Samples of the shortest window: a single spike is no drift."""
LONGEST = 600.0
"""Longest window [s]."""
HOUR = 3600.0
KINDS = ("mean", "energy")


@dataclass(frozen=True)
class Alarm:
    """A window that noise does not explain.

    Attributes:
        t: its end [s].
        channel: name.
        kind: `mean` or `energy`.
        window_s: its length [s].
        value: mean of the residuals, or their root mean square, over sigma.
        p: probability of as much under noise.
        threshold: below which that is an alarm.
    """

    t: float
    channel: str
    kind: str
    window_s: float
    value: float
    p: float
    threshold: float

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


class Alarms:
    """Watches residuals.

    Args:
        channels: names.
        interval: between samples [s].
        rate: expected false alarms per hour, of all channels together.
        margin: what the model may be off by without a fault, over sigma.

    Attributes:
        lengths: of the windows, in samples.
        thresholds: one per length.
        tests: made so far.
    """

    def __init__(
        self, channels: Sequence[str], interval: float, rate: float, margin: float = 0.0
    ) -> None:
        self.channels, self.interval = tuple(channels), interval
        self.rate, self.margin = rate, margin
        count = max(int(np.log2(max(LONGEST / interval / FIRST, 1.0))), 0) + 1
        self.lengths = [FIRST << level for level in range(count)]
        per_hour = [len(KINDS) * len(channels) * HOUR / (n * interval) for n in self.lengths]
        self.thresholds = [min(rate / count / tests, 1.0) for tests in per_hour]
        self.tests = 0
        self.restart()

    def restart(self) -> None:
        """Begin windows anew."""
        width = len(self.channels)
        self._rows = np.zeros((0, width))
        self._times = np.zeros(0)
        self._left: list[tuple[Vector, Vector] | None] = [None] * len(self.lengths)

    def take(self, times: Vector, residuals: Vector) -> list[Alarm]:
        """Alarms of the windows that these rows complete.

        Args:
            times: of the rows [s].
            residuals: over sigma, one column per channel; gaps are NaN.
        """
        rows = np.concatenate([self._rows, residuals])
        stamps = np.concatenate([self._times, times])
        whole = len(rows) // FIRST * FIRST
        self._rows, self._times = rows[whole:], stamps[whole:]
        if not whole:
            return []
        known = np.isfinite(rows[:whole])
        filled = np.where(known, rows[:whole], 0.0).reshape(-1, FIRST, rows.shape[1])
        sums = np.stack(
            [
                filled.sum(axis=1),
                (filled**2).sum(axis=1),
                known.reshape(filled.shape).sum(axis=1).astype(np.float64),
            ],
            axis=1,
        )
        found: list[Alarm] = []
        self._level(0, sums, stamps[FIRST - 1 : whole : FIRST], found)
        return sorted(found, key=lambda alarm: (alarm.t, alarm.window_s))

    def _more(self, square: Vector, n: Vector) -> Vector:
        """Probabilities of a larger sum of squares."""
        if self.margin == 0.0:
            return np.asarray(chdtrc(n, square), dtype=np.float64)
        from scipy.stats import ncx2

        return np.asarray(ncx2.sf(square, n, n * self.margin**2), dtype=np.float64)

    def _level(self, level: int, sums: Vector, ends: Vector, found: list[Alarm]) -> None:
        """Test windows (sum, sum of squares, count) and join them to those of the next length."""
        total, square, count = sums[:, 0], sums[:, 1], sums[:, 2]
        there = count > 0
        n = np.where(there, count, 1.0)
        allowed = self.margin * np.sqrt(n)
        beyond = np.maximum(np.abs(total) / np.sqrt(n) - allowed, 0.0)
        chances = (erfc(beyond / np.sqrt(2.0)), self._more(square, n))
        self.tests += len(KINDS) * int(there.sum())
        values = (total / n, np.sqrt(square / n))
        for kind, chance, value in zip(KINDS, chances, values, strict=True):
            for row, column in np.argwhere((chance < self.thresholds[level]) & there).tolist():
                found.append(
                    Alarm(
                        float(ends[row]), self.channels[column], kind,
                        self.lengths[level] * self.interval, float(value[row, column]),
                        float(chance[row, column]), self.thresholds[level],
                    )
                )  # fmt: skip
        if level + 1 == len(self.lengths):
            return
        left = self._left[level]
        if left is not None:
            sums, ends = np.concatenate([left[0], sums]), np.concatenate([left[1], ends])
        pairs = len(sums) // 2
        self._left[level] = None if len(sums) % 2 == 0 else (sums[-1:], ends[-1:])
        if pairs:
            joined = sums[: 2 * pairs].reshape(pairs, 2, *sums.shape[1:]).sum(axis=1)
            self._level(level + 1, joined, ends[1 : 2 * pairs : 2], found)
