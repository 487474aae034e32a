"""Columns that stand still: constant, frozen for a while, or held for several samples each."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..parts import Channel, MeasuredRun
from .finding import Finding, quantity
from .times import SHORT

if TYPE_CHECKING:
    from ..problem import Problem

Vector = NDArray[np.float64]
LASTS = 20.0
"""A value that stands for so many times as long as usual is frozen."""
HELD = 0.6
"""Share of samples that equal the one before from which a column may be held: white noise of at
least the resolution makes it 0.4 at most (q / (2 sqrt(pi) sigma) with q = sqrt(2) sigma)."""
REGULAR = 0.8
"""Share of changes at one place of a period from which they are regular."""


def check_still(problem: Problem) -> Iterator[Finding]:
    """Inputs and channels that do not move.

    Noise alone makes equal neighbours rare, unless it is finer than the rounding. A stretch that is
    `LASTS` times as long as usual does not come of noise: with a share p of equal neighbours, of n
    samples one such stretch has the probability n p^(LASTS / (1 - p)), 1e-6 for p = 0.4, n = 1e5. A
    machine at rest gives such stretches, too: they are a warning only where rounding hides the
    noise, or where the column stands at the same value elsewhere.
    """
    for run in problem.runs:
        yield from _inputs(run)
        for index, channel in enumerate(problem.channels):
            yield from _column(channel, run, run.data[:, index])
    for index, channel in enumerate(problem.channels):
        values = np.concatenate([run.data[:, index] for run in problem.runs])
        values = values[np.isfinite(values)]
        if values.size and np.ptp(values) == 0.0:
            value = quantity(values[0], channel.unit, "g")
            text = f"is {value} in all runs: a constant channel says nothing"
            yield Finding("error", "constant", "", channel.name, text)


def _inputs(run: MeasuredRun) -> Iterator[Finding]:
    for name, signal in run.inputs.items():
        values = np.asarray(signal.at(run.times))
        if values.size and np.ptp(values) == 0.0:
            text = f"drives {name} with {values[0]:g} throughout: this run excites nothing there"
            yield Finding("warning", "constant", run.name, signal.text.rpartition(":")[2], text)


def _column(channel: Channel, run: MeasuredRun, data: Vector) -> Iterator[Finding]:
    good = np.isfinite(data)
    values = data[good]
    if values.size < SHORT:
        return
    changes = np.flatnonzero(np.diff(values) != 0.0)
    if not changes.size:
        text = f"is {quantity(values[0], channel.unit, 'g')} throughout: a constant channel"
        yield Finding("error", "constant", run.name, channel.name, text)
        return
    if period := held(values, channel.sigma):
        text = (
            f"changes every {period} samples only, though it carries noise: its sensor is slower, "
            "or values were repeated; let each count once with fresh = true in [columns]"
        )
        yield Finding("error", "held", run.name, channel.name, text)
        return
    edges = np.concatenate([[-1], changes, [values.size - 1]])
    longest = int(np.max(np.diff(edges)))
    usual = float(np.mean(np.diff(edges)))
    if not (longest > max(SHORT, LASTS * usual) and longest > 0.02 * values.size):
        return
    start = int(edges[int(np.argmax(np.diff(edges)))]) + 1
    text = (
        f"stands at {quantity(values[start], channel.unit, '.6g')} for {longest} samples from "
        f"{run.logged[good][start]:.4g} s on, "
    )
    # rounding hides noise that is smaller than the quantum: a machine at rest reads so, too; and it
    # comes back to the value that it rests at, which no frozen sensor does
    quantum = float(np.min(np.abs(np.diff(values)[changes])))
    lasting = edges[:-1][np.diff(edges) > SHORT] + 1
    again = int(np.sum(values[lasting] == values[start])) > 1
    if quantum > channel.sigma or again:
        how = "as it does elsewhere" if again else f"to its resolution of {quantum:.3g}"
        text += f"{how}: the machine is at rest there, or the sensor is frozen"
        yield Finding("warning", "frozen", run.name, channel.name, text)
    else:
        text += "though it carries noise: a frozen sensor"
        yield Finding("error", "frozen", run.name, channel.name, text)


def held(values: Vector, sigma: float) -> int:
    """Samples for which each value of a column stands, 0 if that is not regular.

    Of a column that carries noise of its resolution or more, at most 0.4 of the samples equal the
    one before, at places without order: the changes at one of `period` places are then binomial
    about 1 / period, and that `REGULAR` of 30 or more are at one place has a probability below
    1e-9.
    """
    steps = np.abs(np.diff(values))
    changes = np.flatnonzero(steps)
    if changes.size < 30 or changes.size > (1.0 - HELD) * steps.size:
        period = 2  # half of the samples may equal the one before by rounding, but not in order
        if changes.size < 30 or changes.size > 0.55 * steps.size:
            return 0
    else:
        period = round(float(np.median(np.diff(changes))))
    quantum = float(np.min(steps[changes]))
    if quantum > sigma or period < 2:
        return 0
    places = np.bincount(changes % period, minlength=period)
    return period if np.max(places) > REGULAR * changes.size else 0
