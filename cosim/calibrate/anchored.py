"""Noise of the pose from which relative poses count: one sample, and all others have its error.

With relative poses p = (x, y) and psi in the frame of an anchor that was measured (e_x, e_y, e_psi)
off, all samples of a run are off by

    dx = y e_psi - e_x,   dy = -x e_psi - e_y,   dpsi = -e_psi

so that their residuals have the covariance 1 + A A' with three columns, far from white: a heading
off by 4 mrad is 12 mm after 3 m. `whitening` makes them white. Counted where columns show from
sample to sample what is stated (`QUIET`): else `sigma` holds slow errors of a sensor, or what a
model may leave, and its anchor is much better than that.

Not modelled: noise of x and y that differs (their mean square counts, whatever the frame's
heading); that the anchor itself is exactly at 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .checks.smooth import ENOUGH, ORDER, QUIET, roughness

if TYPE_CHECKING:
    from .parts import MeasuredRun
    from .problem import Problem

Vector = NDArray[np.float64]


def anchor_sizes(problem: Problem) -> dict[int, float]:
    """By place of a channel of relative poses, its anchor's noise [its unit].

    What it shows from sample to sample, in the median of the runs that are long enough to tell, and
    no more than is stated; 0 where that is no noise.
    """
    names = [channel.name for channel in problem.channels]
    found = {}
    for index in {names.index(name) for triple in problem.relative for name in triple}:
        columns = [run.data[:, index] for run in problem.runs]
        known = [values[np.isfinite(values)] for values in columns]
        shown = [roughness(values, ORDER) for values in known if values.size > ENOUGH]
        own, stated = float(np.median(shown)) if shown else 0.0, float(problem.sigma[index])
        found[index] = min(own, stated) if own > QUIET * stated else 0.0
    return found


def anchor_noise(problem: Problem, run: MeasuredRun, sizes: Mapping[int, float]) -> list[Vector]:
    """Columns of A, (samples, channels, 3) for each relative pose of a run.

    Args:
        problem: whose channels.
        run: one of it.
        sizes: see `anchor_sizes`.
    """
    names = [channel.name for channel in problem.channels]
    found = []
    for triple in problem.relative:
        place = [names.index(name) for name in triple]
        x, y, _ = np.nan_to_num(run.data[:, place]).T
        unit = problem.sigma[place]
        along, across, turn = (sizes[i] for i in place)
        part = np.zeros((*run.data.shape, 3))
        middle = np.sqrt((along**2 + across**2) / 2.0)
        part[:, place[0], 0], part[:, place[1], 1] = -middle / unit[0], -middle / unit[1]
        part[:, place[0], 2], part[:, place[1], 2] = turn * y / unit[0], -turn * x / unit[1]
        part[:, place[2], 2] = -turn / unit[2]
        found.append(np.where(np.isfinite(run.data)[:, :, np.newaxis], part, 0.0))
    return found
