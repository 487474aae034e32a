"""How much residuals count: squares, Huber's, or less where a whole window is far off.

Where casters turn over a moment too early, residuals of tens of sigma say little about all else;
counted as squares they would decide instead of it. So in problems whose runs may turn unstable, the
noise of a stretch that is far off is taken as unknown, and its likelihood concentrated: with m the
mean of (residual/sigma)^2 over a window of n samples,

    cost = n/2 m                          m <= D
    cost = n/2 D (1 + ln(m / D))          m > D

which is smooth, and the same as squares for a model that is right. Elsewhere a stretch that is far
off is what tells most about an effect that is lacking: comparisons count squares, and fits count
residuals beyond `OUTLYING` sigma linearly. Where only few windows are far off, they may be faults
of the data, and fits of any problem count them by their logarithm.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
WINDOW = 20
"""Measured samples of a channel in a window: noise alone hardly varies over as many."""
DOUBTFUL = 4.0
"""Mean square over the noise's beyond which a window counts by its logarithm; the mean of 20
squares of noise never gets there."""
FEW = 0.02
"""Share of the windows that may be far off in data that a model explains elsewhere."""
OUTLYING = 10.0
"""Residuals over sigma that count linearly where no run turns unstable; no noise is that large."""


class Loss(Protocol):
    """A cost of residuals, and the weights with which least squares has the same gradient."""

    def cost(self, residual: Vector) -> float:
        """Of (samples, channels), NaN where nothing was measured."""
        ...

    def weight(self, residual: Vector) -> Vector:
        """Of each sample; of any value where nothing was measured."""
        ...


@dataclass(frozen=True)
class Squares:
    """Half the sum of squares."""

    def cost(self, residual: Vector) -> float:
        """See `Loss`."""
        return 0.5 * float(np.nansum(residual**2))

    def weight(self, residual: Vector) -> Vector:
        """See `Loss`."""
        return np.ones_like(residual)


@dataclass(frozen=True)
class Huber:
    """Half the sum of squares; residuals beyond `cap` count linearly."""

    cap: float

    def cost(self, residual: Vector) -> float:
        """See `Loss`."""
        size = np.abs(residual[np.isfinite(residual)])
        near = np.minimum(size, self.cap)  # squares of what runs away are no numbers
        each = np.where(size <= self.cap, 0.5 * near**2, self.cap * size - 0.5 * self.cap**2)
        return float(np.sum(each))

    def weight(self, residual: Vector) -> Vector:
        """See `Loss`."""
        size = np.nan_to_num(np.abs(residual))
        return np.asarray(np.minimum(1.0, self.cap / np.maximum(size, 1e-300)))


@dataclass(frozen=True)
class Windowed:
    """Half the sum of squares; windows that are far off count by their logarithm."""

    def cost(self, residual: Vector) -> float:
        """See `Loss`."""
        size = mean_squares(residual)[np.isfinite(residual)]
        return float(np.sum(concentrated(size)))

    def weight(self, residual: Vector) -> Vector:
        """See `Loss`."""
        return trust(mean_squares(residual))


def loss_for(unstable: bool, residuals: Iterable[tuple[str, Vector]] = ()) -> Loss:
    """How residuals count near a solution.

    Args:
        unstable: whether runs may turn unstable.
        residuals: run -> of a model, if what is far off may be few faults of the data.
    """
    far = [mean_squares(r)[np.isfinite(r)] > DOUBTFUL for _, r in residuals]
    few = bool(far) and np.mean(np.concatenate(far)) < FEW
    return Windowed() if unstable or few else Huber(OUTLYING)


def mean_squares(residual: Vector) -> Vector:
    """Mean square of the window of each sample, 0 where nothing was measured."""
    found = np.zeros_like(residual)
    for column, values in enumerate(residual.T):
        good = np.flatnonzero(np.isfinite(values))
        if good.size:
            first = np.arange(0, good.size, WINDOW)
            counts = np.diff(np.append(first, good.size))
            with np.errstate(over="ignore"):  # what has run away is far off, however far
                means = np.add.reduceat(values[good] ** 2, first) / counts
            found[good, column] = np.repeat(means, counts)
    return found


def typical(residuals: Iterable[Vector]) -> float:
    """Median over the windows of their mean squares, of the channel where it is largest."""
    runs = list(residuals)
    sizes = np.concatenate([mean_squares(r) for r in runs])
    measured = np.isfinite(np.concatenate(runs))
    channels = [size[good] for size, good in zip(sizes.T, measured.T, strict=True) if np.any(good)]
    return max((float(np.median(size)) for size in channels), default=0.0)


def concentrated(size: Vector) -> Vector:
    """Cost of each sample from the mean square of its window."""
    beyond = DOUBTFUL * (1.0 + np.log(np.maximum(size, DOUBTFUL) / DOUBTFUL))
    return np.asarray(0.5 * np.where(size <= DOUBTFUL, size, beyond))


def trust(size: Vector) -> Vector:
    """Weight of each sample from the mean square of its window."""
    return np.asarray(DOUBTFUL / np.maximum(size, DOUBTFUL))
