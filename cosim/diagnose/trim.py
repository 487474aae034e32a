"""Bursts of residuals left out of the last fit.

Where casters turn over, the smallest difference decides when: a right model is off by tens of sigma
for some tenths of a second. Of a model that is elsewhere at the noise, such a moment would pull
parameters to wherever it comes at the right time, so it is left out (trimmed least squares), and
the report says so.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..calibrate.fit import fit
from ..calibrate.loss import WINDOW
from ..errors import CosimError
from .deferred import corrected
from .linear import Layout
from .models import Fitted
from .structure import BURST

if TYPE_CHECKING:
    from .search import Search

Vector = NDArray[np.float64]
SUDDEN = 5.0
"""RMS over the noise in a window of a channel from which it is a burst; of noise alone, 20 samples
never reach 3."""


def bursts(residual: Vector, layout: Layout) -> dict[str, NDArray[np.bool_]]:
    """Run -> samples in windows with a burst in any channel, and in the windows beside them."""
    found = {}
    for run, values in zip(layout.runs, layout.by_run(residual), strict=True):
        sudden = np.zeros(len(values), dtype=np.bool_)
        for first in range(0, len(values), WINDOW):
            part = values[first : first + WINDOW]
            count = np.maximum(np.isfinite(part).sum(axis=0), 1)
            if np.any(np.nansum(part**2, axis=0) > SUDDEN**2 * count):
                sudden[max(first - WINDOW, 0) : first + 2 * WINDOW] = True
        if np.any(sudden):
            found[run.name] = sudden
    return found


def trimmed(search: Search, fitted: Fitted) -> tuple[Fitted, dict[str, list[tuple[float, float]]]]:
    """The model fitted without bursts, and the times that were left out, by run.

    It stays as it is where it lacks more, where bursts take more than their share of the time, and
    where the fit without them leaves more than noise.
    """
    sudden = bursts(search.fit_data - fitted.fit, search.fitting)
    total = sum(run.times.size for run in search.fitting.runs)
    # three windows are left out for each with a burst
    if (
        not sudden
        or search.lacking(fitted)
        or sum(map(np.sum, sudden.values())) > 3 * BURST * total
    ):
        return fitted, {}
    theta = fitted.estimate.theta
    try:
        problem = corrected(fitted.problem, theta, search.raw)
        data = {
            name: np.where(where[:, None], np.nan, problem.run(name).data)
            for name, where in sudden.items()
        }
        found = search.judged(fit(problem.with_data(data), theta, near=True))
    except CosimError as error:
        search.say(f"no fit without bursts: {error}")
        return fitted, {}
    found.effects, found.signature = fitted.effects, fitted.signature
    found.gate, found.p_value = fitted.gate, fitted.p_value
    if search.lacking(found):
        return fitted, {}
    times = {name: _spans(search.raw.run(name).times, where) for name, where in sudden.items()}
    return found, times


def written(spans: list[tuple[float, float]]) -> str:
    """Stretches of time for people."""
    return ", ".join(f"{first:.2f} to {last:.2f} s" for first, last in spans)


def _spans(times: Vector, where: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """First and last time of each stretch."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(np.int8)))
    pairs = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return [(float(times[first]), float(times[last - 1])) for first, last in pairs]
