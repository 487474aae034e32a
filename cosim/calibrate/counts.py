"""Speeds from differences of whole counts: the smoothest motion that has these counts.

A counter that shows n_k at sample k was between two of its marks, so of the angle in counts

    |theta_k - n_k| <= 1/2    but for a constant, which no speed knows.

Differences of n_k jump by whole counts where the speed is steady; a model that is driven by them is
shaken, and friction that is small at rest is not what it is then. So, of all motions that have
these counts, the one is taken whose speed bends least,

    minimize sum (third differences of theta)^2,

by a barrier method whose banded systems cost next to nothing. Where the speed does jump, bounds
keep the jump.

A log may show counts with noise on top. Rounding gives them back but for one in thousands, which
moves all angles after it by a count; that one bends the motion, so it is told (`whole_counts`).

Not modelled: marks that are not equally far from each other.

Source: Boyd, Vandenberghe, Convex Optimization (2004), 11.3.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

Vector = NDArray[np.float64]
ORDER = 3
"""Of the differences: speeds that change evenly cost nothing."""
WEIGHTS = 10.0 ** np.arange(-1, 7)
"""Of smoothness over the barrier, one after another. With the last, the bounds' part of the sum is
1e-6 squared counts for each: far below what a count tells of an angle (1/12)."""
STEPS, NEAR = 50, 1e-6
"""Newton steps for a weight at most, and half of the decrease that they still promise which ends
them: of sums near 1 for each sample."""
INSIDE = 0.99
"""Share of the way to a bound that a step may go."""
UNEVEN = 0.1
"""Share of an interval by which others may differ: time stamps jitter, a lost sample doubles it."""
DOUBT = 0.1
"""Distance from the middle between two counts within which rounding is asked again [counts]. Noise
of an eighth of a count goes beyond the middle in one of 16 000 samples, and comes that near in one
of 700."""
BESIDE = 20
"""Samples on each side by whose motion it is told: a count is spread over a few of them at most."""
CLEARLY = 0.5
"""Share to which the other count must lower the bending. In 24 generated logs of crawlers 15 of 21
wrong counts do, to a sixth and less; where the speed rises or falls, those and 22 right ones lower
it to 0.62 to 1, and nothing is known."""


def whole_counts(values: Vector) -> Vector:
    """Whole counts from values with noise on top.

    The nearest; where a value is nearly in the middle of two, the other one if the motion beside it
    bends less by far.

    Args:
        values: counts within each interval, with noise far below one.
    """
    found = np.rint(values)
    for i in np.flatnonzero(np.abs(values - found) > 0.5 - DOUBT):
        first = max(int(i) - BESIDE, 0)
        mine = found[first : i + BESIDE + 1]
        other = mine.copy()
        other[i - first] += np.sign(values[i] - found[i])
        if _bending(other) < CLEARLY * _bending(mine):
            found[i] = other[i - first]
    return found


def _bending(differences: Vector) -> float:
    """Sum of squares of third differences of the smoothest motion with some counts."""
    motion = smoothest(np.concatenate([[0.0], np.cumsum(differences)]))
    return float(np.sum(np.diff(motion, ORDER) ** 2))


def steady(differences: Vector, times: Vector) -> Vector:
    """Speeds of the smoothest motion, from the whole counts within each interval.

    Where intervals are not equal (lost samples), it begins anew.

    Args:
        differences: counts within the interval that ends at each of the times.
        times: of the samples [s].
    """
    found = differences.copy()
    for first, last in stretches(times):
        counted = np.concatenate([[0.0], np.cumsum(differences[first + 1 : last + 1])])
        found[first + 1 : last + 1] = np.diff(smoothest(counted))
    return found


def stretches(times: Vector) -> Iterator[tuple[int, int]]:
    """First and last sample of each stretch of equal intervals."""
    if times.size < 2:
        return
    intervals = np.diff(times)
    usual = np.abs(intervals - np.median(intervals)) < UNEVEN * np.median(intervals)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], usual, [False]])))
    yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def smoothest(counts: Vector) -> Vector:
    """Angles of the smoothest motion with some counts, in counts.

    Args:
        counts: whole ones, at equal intervals.
    """
    if counts.size <= ORDER:
        return counts.copy()
    rows = np.diff(np.eye(2 * ORDER + 1), ORDER, axis=0)
    bands = _bands(counts.size, rows[0, : ORDER + 1])
    bent = np.diff(counts, ORDER)
    found = np.zeros(counts.size)  # angles over the middles of their counts
    for weight in WEIGHTS:
        for _ in range(STEPS):
            above, below = 1.0 / (0.5 - found), 1.0 / (0.5 + found)
            slope = weight * _transposed(bent + np.diff(found, ORDER)) + above - below
            matrix = weight * bands
            matrix[-1] += above**2 + below**2
            step = -solveh_banded(matrix, slope)
            if -0.5 * float(slope @ step) < NEAR * counts.size:
                break
            room = np.where(step > 0.0, 0.5 - found, 0.5 + found)
            reach = float(np.max(np.abs(step) / room, initial=0.0))
            found = found + min(1.0, INSIDE / max(reach, 1e-300)) * step
    return counts + found


def _bands(count: int, row: Vector) -> Vector:
    """D'D in upper banded form, D: differences of so many values."""
    bands = np.zeros((ORDER + 1, count))
    for far in range(ORDER + 1):
        for i in range(ORDER + 1 - far):
            # each row of differences adds its products to the diagonal
            bands[ORDER - far, i + far : count - ORDER + i + far] += row[i] * row[i + far]
    return bands


def _transposed(differences: Vector) -> Vector:
    """D' times a vector."""
    padded = np.concatenate([np.zeros(ORDER), differences, np.zeros(ORDER)])
    return (-1.0) ** ORDER * np.diff(padded, ORDER)
