"""Columns that end at the limit of their sensor, or of the number that keeps them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.special import bdtrc

from .finding import Finding, quantity
from .smooth import noise
from .times import SHORT

if TYPE_CHECKING:
    from ..problem import Problem

Vector = NDArray[np.float64]
BAND = 3.0
"""Deviations of the noise below its largest value in which a column is looked at."""
MOST = 0.5
"""Share of these samples that have the largest value itself, from which it is a limit."""
TOP = 0.25
"""Share of them that have it by chance, at most."""
CHANCE = 1e-6
"""Probability of so many by chance below which fewer than `SHORT` samples tell, too: ten of ten, or
20 of 28. A sensor that ends during short peaks has no more."""
TIMES = 3
"""Stretches at a limit that fewer samples than `SHORT` must make: a value that is held for a while,
where a log ends or a message is lost, is the largest once, and does not come again."""


def check_clipped(problem: Problem, models: Mapping[str, Vector]) -> Iterator[Finding]:
    """Channels that stand at their own largest or smallest value where the model goes beyond it.

    A column with noise finer than its resolution has ever fewer samples towards its largest value:
    noise is unimodal, and so is what a smooth signal adds to it near its top. Half of all samples
    within three deviations having that very value is no noise: the top one of four or more steps of
    a falling histogram has a quarter at most (`TOP`), so half of `SHORT` (50) samples and more have
    a probability of 1e-4, and fewer must have one below `CHANCE`, at several times (`TIMES`). And
    the model must go beyond the value at most of them: a machine that stops at a limit which its
    model has as well is no such case, nor is a command without noise.
    """
    for index, channel in enumerate(problem.channels):
        columns = {run.name: run.data[:, index] for run in problem.runs}
        sigma = noise(list(columns.values()))
        if sigma is None:
            continue
        for side, word in ((1.0, "largest"), (-1.0, "smallest")):
            edge = side * max(float(np.nanmax(side * v, initial=-np.inf)) for v in columns.values())
            at = {name: v == edge for name, v in columns.items()}
            count = sum(int(np.sum(a)) for a in at.values())
            near = sum(int(np.sum(side * (edge - v) <= BAND * sigma)) for v in columns.values())
            by_chance = float(bdtrc(count - 1, near, TOP)) if 0 < count < near else TOP**count
            often = sum(int(np.sum(a & ~np.append(False, a[:-1]))) for a in at.values())
            if count < MOST * near or (count < SHORT and (by_chance > CHANCE or often < TIMES)):
                continue
            beyond = [
                side * (models[name][a, index] - edge) > BAND * channel.sigma
                for name, a in at.items()
            ]
            if not float(np.mean(np.concatenate(beyond))) > MOST:
                continue
            runs = [name for name, a in at.items() if a.any()]
            text = (
                f"stands at its {word} value of {quantity(edge, channel.unit, '.6g')} for {count} "
                f"samples, without the noise that it has elsewhere, where the model goes beyond "
                f"it (runs {', '.join(runs)}): the sensor or its number ends there; "
                + _way(edge, side, channel.unit, columns)
            )
            yield Finding("error", "clipped", "", channel.name, text)


def _way(edge: float, side: float, unit: str, columns: Mapping[str, Vector]) -> str:
    """How to make gaps of the values at a limit: `limit` takes both sides, of what was logged."""
    beyond = max(float(np.nanmax(-side * v, initial=-np.inf)) for v in columns.values())
    if beyond > abs(edge):
        return (
            "empty their cells in the log, which are gaps then (limit in [columns] takes both "
            "signs, and the column goes further on the other side)"
        )
    own = f", if that is not in {unit}" if unit else ""
    return (
        f"make gaps of them with limit = {(1.0 - 1e-6) * abs(edge):.7g} in [columns], converted to "
        f"the unit that the column has in the log{own}"
    )
