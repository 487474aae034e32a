"""Intervals that hold parameters in all sets that the data do not tell from the one that is named.

A gain of the left wheel is the inverse gain of the right one on wheels of another radius. If the
data do not tell two such sets apart, they do not tell which of the two radii is the right one,
however sharply each set knows its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .facts import Law, Model, Value
from .models import Fitted


def held_by_all(law: Law, alike: Sequence[Model]) -> Law:
    """A law with intervals that hold its parameters as other sets have them, too.

    Args:
        law: of the set that is named.
        alike: the other sets; those that lack the law say nothing of it.
    """
    theirs = [v for model in alike for one in model.laws if one.label == law.label
              for v in one.values]  # fmt: skip
    return replace(law, values=tuple(_hull(v, theirs) for v in law.values))


def _hull(value: Value, theirs: Sequence[Value]) -> Value:
    same = [v for v in theirs if v.name == value.name]
    # of what a set leaves open, it says no more than its bounds
    low = min([value.low, *(v.low if v.identifiable else v.value for v in same)])
    high = max([value.high, *(v.high if v.identifiable else v.value for v in same)])
    return replace(value, low=low, high=high)


def hold_all(fitted: Fitted, alike: Sequence[Fitted]) -> list[str]:
    """Let the declared parameters' intervals hold what they are in other sets; who differs.

    Args:
        fitted: the model that is named; gets the intervals.
        alike: the other sets, as they were fitted.

    Returns:
        What is said of each parameter that another set has beyond the interval of this one.
    """
    estimate, said = fitted.estimate, []
    names = estimate.problem.names
    low, high = estimate.low, estimate.high
    for other in alike:
        low, high = low.copy(), high.copy()
        theirs, moved = other.estimate, []
        for k, p in enumerate(theirs.problem.parameters):
            if p.role != "declared" or p.name not in names:
                continue
            i, value = names.index(p.name), float(theirs.theta[k])
            known = bool(theirs.identifiable[k])
            if known and estimate.identifiable[i] and not low[i] <= value <= high[i]:
                moved.append(f"{p.name} = {value:.4g} {p.unit}".rstrip())
            low[i] = min(low[i], float(theirs.low[k]) if known else value)
            high[i] = max(high[i], float(theirs.high[k]) if known else value)
        if moved:
            laws = " and ".join(sorted(other.labels - fitted.labels))
            said.append(
                f"with {laws} instead, which the data do not tell from it, {', '.join(moved)}: "
                "intervals hold both"
            )
    fitted.estimate = replace(
        estimate,
        low=np.maximum(low, estimate.problem.lower),
        high=np.minimum(high, estimate.problem.upper),
    )
    return said
