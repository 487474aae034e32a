"""Noise of the pose from which relative poses count: one sample, and all others have its error.

With relative poses p = (x, y) and psi in the frame of an anchor that was measured (e_x, e_y, e_psi)
off, all samples of a run are off by

    dx = y e_psi - e_x,   dy = -x e_psi - e_y,   dpsi = -e_psi

so that their residuals have the covariance 1 + A A' with three columns, far from white: a heading
off by 4 mrad is 12 mm after 3 m. `whitening` makes them white.

Not modelled: noise of x and y that differs (their mean square counts, whatever the frame's
heading); that the anchor itself is exactly at 0.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from .parts import MeasuredRun
    from .problem import Problem

Vector = NDArray[np.float64]


def anchor_noise(problem: Problem, run: MeasuredRun) -> list[Vector]:
    """Columns of A, (samples, channels, 3) for each relative pose of a run.

    Args:
        problem: whose channels.
        run: one of it.
    """
    names = [channel.name for channel in problem.channels]
    found = []
    for triple in problem.relative:
        place = [names.index(name) for name in triple]
        x, y, _ = np.nan_to_num(run.data[:, place]).T
        along, across, turn = problem.sigma[place]
        part = np.zeros((*run.data.shape, 3))
        middle = np.sqrt((along**2 + across**2) / 2.0)
        part[:, place[0], 0], part[:, place[1], 1] = -middle / along, -middle / across
        part[:, place[0], 2], part[:, place[1], 2] = turn * y / along, -turn * x / across
        part[:, place[2], 2] = -1.0
        found.append(np.where(np.isfinite(run.data)[:, :, np.newaxis], part, 0.0))
    return found
