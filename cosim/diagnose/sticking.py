"""A law that smooths a sign, with less of that: a move of fits where runs may turn unstable."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import CosimError
from .candidates import new_parameters
from .models import GATE, Fitted, is_open

if TYPE_CHECKING:
    from .fitter import Fitter

SHARP = 0.01
"""Share of a law's usual smoothing with which it is fitted, too, where runs may turn unstable."""


def sharper(fitter: Fitter, winner: Fitted, base: Fitted) -> Fitted:
    """The model with its last effect's law sticking more nearly, if it fits better from here.

    A law that smooths a sign creeps at rest. Where it holds casters, all parameters make up for
    that, and derivatives do not lead to where it hardly creeps.

    Args:
        fitter: of the search.
        winner: a fit, whose last law may stick.
        base: without that law.
    """
    item = winner.signature
    if item is None or not fitter.raw.unstable or not is_open(winner.estimate):
        return winner
    whole = item.candidate.added_to(base.problem)
    held = {
        p.name: (p.minimum, item.fixed.get(p.name, p.nominal))
        for p in new_parameters(base.problem, whole)[1]
        if p.name not in winner.estimate.values
    }
    sharp = {n: max(SHARP * value, least) for n, (least, value) in held.items() if least > 0.0}
    if not sharp:
        return winner
    fixed = {n: value for n, (_, value) in held.items()} | sharp
    spans = {p.name: p.span for p in winner.problem.parameters}
    problem = whole.with_parameters(
        [replace(p, span=spans.get(p.name, p.span)) for p in whole.parameters]
    ).changed(runs=winner.problem.runs)
    problem = problem.hold(fixed)
    theta = np.array([winner.estimate.values[name] for name in problem.names])
    try:
        found = fitter.fitted(fitter.simulator.of(problem), theta, winner.estimate)
    except CosimError as error:
        fitter.say(f"{winner.effects[-1].label} with {sharp}: {error}")
        return winner
    if not found.estimate.robust < winner.estimate.robust - GATE:
        return winner
    fitter.say(f"{winner.effects[-1].label}: sticks more nearly than usual")
    found = fitter.again(found, winner, base)
    found.signature = item.at(fixed)
    return found
