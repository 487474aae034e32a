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
from ..calibrate.fit import CORRECTION, fit
from ..errors import CosimError
from .models import Fitted, is_open

if TYPE_CHECKING:
    from .fitter import Fitter


def grounded(fitter: Fitter, winner: Fitted, base: Fitted) -> Fitted:
    """The model, with parameters from the rig's own step where they are better.

    Args:
        fitter: of the search.
        winner: a thorough fit.
        base: from which gains count.
    """
    raw = fitter.raw
    coarse = raw.ticks and raw.search.step != raw.step
    if not coarse or raw.unstable or is_open(winner.estimate) or astray(fitter, winner) < LOWER:
        return winner
    measured = {run.name: run.data for run in raw.runs}
    problem = winner.problem.with_data(measured).changed(step=raw.step)
    name = winner.effects[-1].label
    try:
        simulator = winner.simulator.limited({}).of(problem)
        fine = fit(simulator, winner.estimate.theta, effort=CORRECTION)
        near = corrected(winner.simulator, fine.theta, raw)
    except CosimError as error:
        fitter.say(f"{name} could not be fitted at the rig's step: {error}")
        return winner
    found = fitter.again(fitter.judged(replace(fine, simulator=near)), winner, base)
    gained = _cost(fitter, winner) - _cost(fitter, found)
    fitter.say(f"{name}: {gained:.0f} nats better at the rig's own step")
    return found


def astray(fitter: Fitter, fitted: Fitted) -> float:
    """How far the cost that a fit saw at its end is from that at the rig's own step [nats]."""
    stack, rows = fitter.fitting, dict(fitted.estimate.residuals)
    seen = stack.cost(stack.vector([rows[name] for name in stack.names]))
    return abs(seen - _cost(fitter, fitted))


def _cost(fitter: Fitter, fitted: Fitted) -> float:
    return fitter.fitting.cost(fitter.fit_data - fitted.fit)
