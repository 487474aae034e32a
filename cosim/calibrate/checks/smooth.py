"""Columns without the noise that they are said to carry: low-passed, interpolated, or simulated."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import comb
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..estimate import channel_rms
from .finding import Finding, quantity
from .still import held

if TYPE_CHECKING:
    from ..estimate import Estimate
    from ..problem import Problem

Vector = NDArray[np.float64]
ORDER = 8
"""Of the differences: they weigh the noise near half the sample rate, and no smooth motion."""
ENOUGH = 200
"""Samples that a run needs: the deviation of what is estimated is then below a tenth."""
QUIET = 0.5
"""Share of the stated noise below which a column is smoother than it can be."""
FALLS = 0.6
"""Ratio of the noise by differences of twice the order to that by `ORDER` below which it falls
towards half the sample rate; of white noise, however small, it is 1."""
WHITE = 0.8
"""The same ratio above which noise is white: 1 less twice its deviation of a tenth (`ENOUGH`)."""
LOUD = 2.0
"""Times the stated noise from which a column carries more than it is said to."""


def roughness(values: Vector, order: int) -> float:
    """Deviation of white noise as differences of some order show it.

        s = median |D^n x| / (0.6745 sqrt(C(2 n, n)))

    Motion that a polynomial of degree n - 1 follows over n + 1 samples does not count, and by the
    median, nor do steps and jolts: what is not noise can only add. Gaps do not count.
    """
    steps = np.diff(values, order)
    steps = steps[np.isfinite(steps)]
    if not steps.size:
        return 0.0
    return float(np.median(np.abs(steps))) / (0.6745 * float(np.sqrt(comb(2 * order, order))))


def noise(columns: Sequence[Vector]) -> float | None:
    """Deviation of a column's white noise, None if it has none, or none finer than its resolution.

    Noise that falls towards half the sample rate is motion or a filter (`FALLS`). What may
    be a limit does not count.
    """
    sizes, falls, steps = [], [], []
    everything = np.concatenate([v[np.isfinite(v)] for v in columns])
    low, high = np.min(everything, initial=np.inf), np.max(everything, initial=-np.inf)
    for column in columns:
        values = np.where((column > low) & (column < high), column, np.nan)
        if int(np.isfinite(values).sum()) <= ENOUGH:
            continue
        own, twice = roughness(values, ORDER), roughness(values, 2 * ORDER)
        if own > 0.0:
            sizes.append(own)
            falls.append(twice / own)
            moves = np.abs(np.diff(values))
            steps.append(float(np.min(moves[moves > 0.0])))
    if not sizes or float(np.median(falls)) < FALLS or min(steps) > float(np.median(sizes)):
        return None
    return float(np.median(sizes))


def _carried(problem: Problem, index: int) -> tuple[float, float] | None:
    """A channel's noise over what is stated, and how it falls (`FALLS`), in the median of the runs.

    None where that cannot be told: the mapping filters the column, or no run is long enough, moves,
    and is not held.
    """
    channel, sizes, falls = problem.channels[index], [], []
    if channel.name in problem.source.made:
        return None
    for run in problem.runs:
        values = run.data[:, index]
        values = values[np.isfinite(values)]
        moving = values.size > ENOUGH and np.mean(np.diff(values) != 0.0) > 0.5
        if not moving or held(values, channel.sigma):
            continue
        own, twice = roughness(values, ORDER), roughness(values, 2 * ORDER)
        sizes.append(own / channel.sigma)
        falls.append(twice / own if own > 0.0 else 0.0)
    return (float(np.median(sizes)), float(np.median(falls))) if sizes else None


def check_stated(estimate: Estimate) -> Iterator[Finding]:
    """Channels of which neither the noise nor what a fit leaves comes near what is stated.

    A sigma that is too large hides what is smaller than it. The white noise of a column alone does
    not tell: what is stated may hold slow errors of a sensor as well, or of a model (a pose from
    scans or cameras is off by ten times what it trembles). Those are in what a fit leaves. Where
    both are below `QUIET` of what is stated, there is nothing that it could be: of n residuals of
    that deviation their root mean square has one of 1 / sqrt(2 n), 0.05 of `ENOUGH` samples. What a
    fit leaves counts over all runs that were fitted.
    """
    problem = estimate.problem
    left = channel_rms(problem, estimate.residuals)
    for index, channel in enumerate(problem.channels):
        carried = _carried(problem, index)
        if carried is None or channel.name not in left:
            continue
        (size, falls), rest = carried, left[channel.name]
        if size < QUIET and falls > WHITE and rest < QUIET:
            text = (
                f"carries {size:.2g} of its stated noise of "
                f"{quantity(channel.sigma, channel.unit)}, and the fit leaves {rest:.2g} of it: "
                "what is smaller than that stays hidden, and "
                f"intervals come out too wide; state sigma = {size * channel.sigma:.3g}"
            )
            yield Finding("warning", "noise", "", channel.name, text)


def check_smooth(problem: Problem) -> Iterator[Finding]:
    """Channels whose noise near half the sample rate is below what they are said to carry.

    Noise of a sensor that is independent from sample to sample adds to whatever moves, so that
    `roughness` over the stated deviation is 1 or more (0.87 to 1.2 over all runs of the rigs'
    sheets, with and without undeclared effects; its own deviation is 1.2 / sqrt(n / ORDER)). Below
    `QUIET`, in the median of the runs, the column was low-passed or interpolated after it was
    measured, and what a fit does with it is wrong twice: its lag is taken for physics, and its
    samples are not independent. A deviation that the mapping states may be a guess: then the noise
    must fall towards half the sample rate as well, which white noise of any size does not.
    Columns that the mapping itself filters or brings to another clock are not tested.
    """
    quiet: list[tuple[str, str, bool]] = []
    count = 0
    for index, channel in enumerate(problem.channels):
        carried = _carried(problem, index)
        if carried is None:
            continue
        count += 1
        size, falls = carried
        instrument = channel.name in problem.source.instruments
        if size > LOUD and falls > WHITE:
            text = (
                f"carries {size:.3g} times its stated noise of "
                f"{quantity(channel.sigma, channel.unit)}: intervals come out too narrow, and "
                "noise may be taken for physics; state "
                f"sigma = {size * channel.sigma:.3g}"
            )
            yield Finding("warning", "noise", "", channel.name, text)
        if size < QUIET and (instrument or falls < FALLS):
            text = (
                f"carries {size:.2g} of its stated noise of "
                f"{quantity(channel.sigma, channel.unit)} near half the sample rate: it was "
                "low-passed or interpolated, or its noise is another; take the raw column, or "
                "state its noise as sigma"
            )
            quiet.append((channel.name, text, instrument))
    whole = len(quiet) == count
    for name, text, instrument in quiet:
        severity = "error" if instrument or whole else "warning"
        yield Finding(severity, "smoothed", "", name, text)
