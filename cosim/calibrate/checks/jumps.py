"""Columns that go on from another value: a count set to 0, a pose that was corrected."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .finding import Finding, quantity
from .spiking import NEAR, without_spikes

if TYPE_CHECKING:
    from ..problem import Problem

Vector = NDArray[np.float64]
STANDS_OUT = 10.0
"""Times the noise, and times all other steps of its column, that a jump is at least."""
SHARED = 0.1
"""Share of a jump from which the model, which moves there, may have it, too."""
MOST = 5
"""Jumps in a run at most: what jumps more often moves so."""
USUAL = 1.5
"""Times the usual interval from which a step goes over rows that are lost."""


def check_jumps(problem: Problem, models: Mapping[str, Vector]) -> Iterator[Finding]:
    """Steps from one sample to the next that stay, and that nothing else in the run comes near.

    They are `STANDS_OUT` times all other steps of the column, which noise does not do in any of
    1e6 samples, and the model moves by less than `SHARED` of them about there. What ends where the
    column began has been set back. Anything else may be a blow that the model lacks, and is a
    warning.
    """
    for run in problem.runs:
        if run.name not in models or run.times.size < 3:
            continue
        apart = np.diff(run.logged)
        for index, channel in enumerate(problem.channels):
            values = without_spikes(run.data[:, index], channel.sigma)
            steps = np.abs(np.diff(values))
            steps[~np.isfinite(steps) | (apart > USUAL * np.median(apart))] = 0.0
            at = _few(steps, STANDS_OUT * channel.sigma)
            moves = np.abs(np.diff(models[run.name][:, index]))
            at = [k for k in at if np.nanmax(moves[max(k - NEAR, 0) : k + NEAR + 1])
                  < SHARED * steps[k]]  # fmt: skip
            if not at:
                continue
            k = at[0]
            begun = values[np.isfinite(values)][0]
            anew = abs(values[k + 1] - begun) < STANDS_OUT * channel.sigma
            text = (
                "jumps where the model does not"
                + (f" ({len(at)} times, first)" if len(at) > 1 else "")
                + f" from {values[k]:.6g} to "
                f"{quantity(values[k + 1], channel.unit, '.6g')} after {run.logged[k]:.6g} s: "
                + ("set back to where it began" if anew else "a correction, or a blow")
                + "; give what is before and what comes after it a run each, with samples"
            )
            yield Finding("error" if anew else "warning", "jump", run.name, channel.name, text)


def _few(steps: Vector, least: float) -> list[int]:
    """Places of the few steps that are far larger than all others, in their order."""
    largest = np.argsort(-steps, kind="stable")[: MOST + 1]
    sizes = steps[largest]
    for count in range(min(MOST, sizes.size - 1), 0, -1):
        if sizes[count - 1] > max(least, STANDS_OUT * sizes[count]):
            return sorted(largest[:count].tolist())
    return []
