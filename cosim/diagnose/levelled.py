"""Sets close behind the one that would be named, fitted as near to their minima as it.

What is compared only is fitted roughly, and ends tens of nats above its minimum, hundreds where a
valley is bent. Two laws that are nearly one would be told apart by where their fits ended.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..calibrate.fit import MINIMUM
from ..errors import CosimError
from .facts import one_law
from .late_values import LateValueFitter
from .memo import Labels
from .models import Fitted

CLOSE = 0.95
"""Share of what a law gains from which others in its place are fitted as far as it: rough fits end
where a step takes a few hundredths of what is left."""
CLOSEST = 2
"""Sets that are fitted so at most, the best: each costs as much as the named one's last fit."""


def levelled(search: LateValueFitter, fitted: Fitted, done: set[Labels]) -> None:
    """Fit sets with another law in the place of one of a set's, that do nearly as much, to the end.

    The memo gets the fits, and the verdict decides. Not asked where runs may turn unstable: where
    fits end is chance there.

    Args:
        search: fits and judges.
        fitted: the set, thoroughly fitted.
        done: sets that have been fitted so, and are not again; gets those that are.
    """
    close = [] if search.raw.unstable else _close(search, fitted, done)
    for rival, less in close[:CLOSEST]:
        done.add(rival.labels)
        names = ", ".join(sorted(rival.labels))
        search.say(f"{names}: close enough to be fitted as far")
        near = to_minimum(search, _from(search, rival, fitted), fitted, less)
        search.say(f"{names}: {search.total(fitted, near):+.1f} nats on all runs")
        if search.total(fitted, near) > 0.0 or not search.apart(fitted, near):
            search.sharpened(near, less)  # the memo gets it with intervals


def to_minimum(search: LateValueFitter, trial: Fitted, goal: Fitted, base: Fitted) -> Fitted:
    """A model fitted to its minimum, as long as its derivatives promise that it may be as good.

    Args:
        search: fits and judges.
        trial: the model.
        goal: another one that does better.
        base: what gains count from.
    """
    return search.sharpened(trial, base, MINIMUM, search.enough(goal, trial))


def _close(
    search: LateValueFitter, fitted: Fitted, done: set[Labels]
) -> list[tuple[Fitted, Fitted]]:
    """Such sets, the best first, and the set without the law in which they differ.

    Special cases have been fitted from where the set is (`rivals.simplified`).
    """
    found = []
    for rival in search.memo:
        mine = [e for e in fitted.effects if e.label not in rival.labels]
        other = [e for e in rival.effects if e.label not in fitted.labels]
        if rival.labels in done or len(mine) != 1 or len(other) != 1 or one_law(mine[0], other[0]):
            continue
        less = search.memo.get(fitted.labels - {mine[0].label})
        if less is None:
            continue
        behind = search.total(rival, fitted)
        if behind < (1.0 - CLOSE) * search.total(less, fitted):
            found.append((behind, rival, less))
    found.sort(key=lambda item: item[0])
    return [(rival, less) for _, rival, less in found]


def _from(search: LateValueFitter, rival: Fitted, fitted: Fitted) -> Fitted:
    """A set's fit, begun with the values of another one for what they share, if that is better."""
    values = {**rival.estimate.values, **fitted.estimate.values}
    theta = np.array([values[name] for name in rival.problem.names])
    simulator = rival.simulator
    try:
        start = search.cost(simulator, theta) < search.cost(simulator, rival.estimate.theta)
    except CosimError as error:
        search.say(f"{', '.join(sorted(rival.labels))} from other values: {error}")
        return rival
    return replace(rival, estimate=replace(rival.estimate, theta=theta)) if start else rival
