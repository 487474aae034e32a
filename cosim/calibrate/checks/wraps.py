"""Angles that begin anew at a turn where the model counts on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...errors import UnitError
from ...spec.units import parse
from .finding import Finding

if TYPE_CHECKING:
    from ..problem import Problem

Vector = NDArray[np.float64]
NEAR = 0.2
"""Share of a turn by which a jump may miss it: what moves between two samples."""


def check_wraps(problem: Problem, models: Mapping[str, Vector]) -> Iterator[Finding]:
    """Jumps by a turn from one sample to the next that the model does not have.

    What the model leaves of a column jumps by a turn (to `NEAR`), while half of its changes are
    smaller than a hundredth of that: no noise does so whose deviation is below a tenth of a turn.
    """
    for index, channel in enumerate(problem.channels):
        try:
            unit = parse(channel.unit or problem.system().variables(channel.signal)[1][0].symbol)
        except UnitError:
            continue
        if unit.exponents != parse("rad").exponents:
            continue
        turn = 2.0 * np.pi / unit.factor
        for run in problem.runs:
            if run.name not in models:
                continue
            good = np.isfinite(run.data[:, index])
            left = (run.data[:, index] - models[run.name][:, index])[good]
            steps = np.abs(np.diff(left))
            if steps.size < 2 or np.median(steps) > 0.01 * turn:
                continue
            at = np.flatnonzero(np.abs(steps / turn - 1.0) < NEAR)
            if at.size:
                text = (
                    f"jumps by a turn {at.size} times, "
                    f"first after {run.logged[good][at[0]]:.6g} s, where the model "
                    "counts on; give unwrap = true in [columns]"
                )
                yield Finding("error", "wrapped", run.name, channel.name, text)
