"""Ends of runs that tell nothing: what happens there hangs on more than anybody can know.

Where dry friction holds casters, a thousandth of a radian of a start angle decides seconds later
when one turns over. A model that has the right law and misses that moment is far off from there on,
and whatever changes the moment seems to explain it. Before a further effect is looked for, a run is
therefore ended where

    the model has left it:        a window of a channel beyond `LEFT` (see `calibrate.staged`), and
    it has become sensitive:      a tenth of what is known of a late value beforehand changes a
                                  window of a channel by more than the noise, there or earlier.

A model that leaves a run that is not sensitive lacks something else, and the run counts.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..calibrate.loss import WINDOW, mean_squares
from ..calibrate.nuisance import starts
from ..calibrate.problem import Problem
from ..calibrate.simulator import Simulator
from ..calibrate.staged import LEAST, LEFT

Vector = NDArray[np.float64]
SHARE = 0.1
"""Part of a late value's standard deviation beforehand by which it is changed: fits know these
values better than that only as far as what they decide came out right."""
SEEN = 1.0
"""Mean square over the noise's of a window from which that change is seen."""


def ends(simulator: Simulator, theta: Vector, names: Sequence[str]) -> dict[str, int]:
    """Run -> samples up to where the model has left it by an instability; others are not named.

    Args:
        simulator: of a problem with late parameters.
        theta: fitted parameters.
        names: runs.
    """
    residuals = dict(simulator.residuals(theta, list(names)))
    moved: dict[str, Vector] = {}
    for changed in _changed(simulator.problem):
        for name, residual in simulator.limited({}).of(changed).residuals(theta, list(names)):
            change = mean_squares(residual - residuals[name])
            moved[name] = np.maximum(moved.get(name, 0.0), change.max(axis=1))
    found = {}
    for name, change in moved.items():
        sensitive = np.flatnonzero(change > SEEN)
        if not sensitive.size:
            continue
        left = np.any(mean_squares(residuals[name]) > LEFT, axis=1)
        # windows are shorter than what leads to a moment: the one before may have told already
        gone = np.flatnonzero(left & (np.arange(left.size) >= sensitive[0] - WINDOW))
        if gone.size:
            found[name] = max(int(gone[0]), int(LEAST * left.size))
    return found


def ended(problem: Problem, sizes: Mapping[str, int]) -> Problem:
    """A problem whose runs end after so many samples."""
    runs = [
        replace(run, times=run.times[: sizes[run.name]], data=run.data[: sizes[run.name]])
        if run.name in sizes else run
        for run in problem.runs
    ]  # fmt: skip
    return problem.changed(runs=runs)


def _changed(problem: Problem) -> list[Problem]:
    """The problem with one late value of each run moved, for each of them."""
    known = dict(zip((p.name for p in problem.late), starts(problem), strict=True))
    place: Counter[str] = Counter()
    found: list[dict[str, dict[str, float]]] = []
    for p in problem.late:
        if place[p.run] == len(found):
            found.append({})
        value = known[p.name] + SHARE * (p.prior or p.scale)
        found[place[p.run]][p.run] = p.set(value)
        place[p.run] += 1
    return [
        problem.changed(
            runs=[
                replace(run, starts={**run.starts, **moved.get(run.name, {})})
                for run in problem.runs
            ]
        )
        for moved in found
    ]
