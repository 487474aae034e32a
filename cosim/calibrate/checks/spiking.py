"""Single samples that stand out: lost bits, not motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..columns import spikes
from .finding import Finding

if TYPE_CHECKING:
    from ..problem import Problem

Vector = NDArray[np.float64]


def check_spikes(problem: Problem, models: Mapping[str, Vector]) -> Iterator[Finding]:
    """Samples that stand out in the data (`columns.spikes`) and in what the model leaves of them.

    Of white Gaussian noise a sample passes for one once in 1e9. A jolt that lasts one sample and is
    the model's, too, is none; one that the model lacks passes, and is let pass by name.
    """
    for index, channel in enumerate(problem.channels):
        for run in problem.runs:
            values = run.data[:, index]
            found = spikes(values, channel.sigma)
            if run.name in models:
                found &= spikes(values - models[run.name][:, index], channel.sigma)
            at = np.flatnonzero(found)
            if not at.size:
                continue
            worst = at[int(np.argmax(np.abs(values[at] - values[at - 1])))]
            text = (
                f"has {at.size} single samples that stand out, the first at "
                f"{run.times[at[0]]:.6g} s, the largest {values[worst]:.6g} {channel.unit} at "
                f"{run.times[worst]:.6g} s between {values[worst - 1]:.6g} and "
                f"{values[worst + 1]:.6g}: faults of the log; make gaps of them with despike = true "
                "(or limit) in [columns]"
            )
            yield Finding("error", "spikes", run.name, channel.name, text)
