"""What the data would have shown: the smallest strength of each effect that cannot be missed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.special import ndtri, stdtrit

from .linear import MATERIAL, SampleStack
from .models import LEVEL
from .rounds import Round

POWER = 0.9
"""Probability with which an effect of the given strength is found."""


def power(current: Round, stack: SampleStack) -> dict[str, dict[str, Any]]:
    """Label -> smallest detectable strength, or why the effect cannot be seen.

    Detected is what the score test tells from nothing and what is `MATERIAL`, in the shape that was
    simulated; the gate on unused runs is not in it.
    """
    tests = max(len(current.signatures) + len(current.aside), 1)  # as of the round's p values
    level = LEVEL / tests
    table: dict[str, dict[str, Any]] = {}
    for item in current.signatures:
        p = item.strength
        entry: dict[str, Any] = {"unit": p.unit, "parameter": p.name, "absorbed": item.absorbed}
        if item.unseen:
            entry["smallest_detectable"] = None
            entry["reason"] = (
                "the runs do not excite it"
                if item.score.size == 0.0
                else "calibration of the declared parameters absorbs it"
            )
        else:
            told = (
                math.sqrt(-2.0 * math.log(level))
                if item.probe.mix
                else -float(stdtrit(item.score.degrees, level / 2))
            )  # as of the round's p values
            needed = told - float(ndtri(1 - POWER))
            # the norm of what calibration leaves grows with the strength around the secant's value
            size = item.score.size / max(item.score.spread, 1.0)
            smallest = abs(item.value) * needed / size if size > 0 else math.inf
            share = stack.largest(item.rest.astype(np.float64))
            if share > 0.0:
                smallest = max(smallest, abs(item.value) * MATERIAL / share)
            entry["smallest_detectable"] = smallest if math.isfinite(smallest) else None
            if abs(math.log10(max(smallest / abs(item.value), 1e-12))) > 1.5:
                entry["extrapolated_from"] = abs(item.value)
        entry["same_as"] = list(item.same)
        table[item.candidate.label] = entry
    return table
