"""Fits at the rig's own step, where what a coarser one adds to the model is not what was taken off.

What a coarse communication step adds is taken from the data at one point, where a fit begins
(`deferred`). Where runs meet limits or teeth by ticks, it is another one where the fit ends: the
data are right for the beginning only, and derivatives of the coarse model lead elsewhere. Steps at
the rig's own step need no correction.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ..calibrate.deferred import corrected
from ..calibrate.descent import LOWER
from ..calibrate.fit import CORRECTION, DRAFT, fit
from .models import Fitted, is_open

if TYPE_CHECKING:
    from .fitter import Fitter

DRAFTS = 2
"""Drafts at most: where the second one still ends elsewhere, a third does, too."""


def thorough(fitter: Fitter, quick: Fitted, base: Fitted) -> Fitted:
    """A model fitted to its minimum, with intervals.

    By drafts first, until one ends where what the step adds is what was taken off; if none does, at
    the rig's own step.

    Args:
        fitter: of the search.
        quick: the model, fitted quickly.
        base: from which gains count.

    Raises:
        CosimError: it cannot be simulated.
    """
    raw = fitter.raw
    if not raw.ticks or raw.search.step == raw.step or raw.unstable or is_open(quick.estimate):
        return fitter.corrected(quick, base, CORRECTION)
    near = quick
    for _ in range(DRAFTS):
        near = fitter.corrected(near, base, DRAFT)
        if astray(fitter, near) < LOWER:
            found = fitter.corrected(near, base, CORRECTION)
            return found if astray(fitter, found) < LOWER else _grounded(fitter, found, base)
    return _grounded(fitter, near, base)


def _grounded(fitter: Fitter, near: Fitted, base: Fitted) -> Fitted:
    """The model fitted at the rig's own step from close by."""
    raw = fitter.raw
    measured = {run.name: run.data for run in raw.runs}
    problem = near.problem.with_data(measured).changed(step=raw.step)
    fine = fit(near.simulator.limited({}).of(problem), near.estimate.theta, effort=CORRECTION)
    simulator = corrected(near.simulator, fine.theta, raw)
    found = fitter.again(fitter.judged(replace(fine, simulator=simulator)), near, base)
    gained = _cost(fitter, near) - _cost(fitter, found)
    fitter.say(f"{near.effects[-1].label}: {gained:.0f} nats better at the rig's own step")
    return found


def astray(fitter: Fitter, fitted: Fitted) -> float:
    """How far the cost that a fit saw at its end is from that at the rig's own step [nats]."""
    stack, rows = fitter.fitting, dict(fitted.estimate.residuals)
    seen = stack.cost(stack.vector([rows[name] for name in stack.names]))
    return abs(seen - _cost(fitter, fitted))


def _cost(fitter: Fitter, fitted: Fitted) -> float:
    return fitter.fitting.cost(fitter.fit_data - fitted.fit)
