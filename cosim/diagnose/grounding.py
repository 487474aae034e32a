"""Fits at the rig's own step, for a model that leaves more than noise at a coarser one.

What a coarse communication step adds to the model is taken from the data at one point (`deferred`).
Where runs meet limits by ticks, that varies so much with the parameters that a fit which begins at
this point ends there: the data are only right for it. Steps at the rig's own step need no
correction, and lead to where the correction is taken next. Counts of cycles per turn are spanned by
one cycle more in a run there: over their own sizes, differences turn the phase by whole turns.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..calibrate.fit import MINIMUM, Effort, fit
from ..errors import CosimError
from .models import Fitted

if TYPE_CHECKING:
    from .fitter import Fitter

EVIDENT = 3.0
"""Deviations by which the cost exceeds that of noise: half a sum of n squares varies by
sqrt(n / 2)."""
STEPS = Effort("near", "draft", iterations=4)
"""Each costs as many simulations as there are parameters, at a step that is ten times as fine."""


def thorough(fitter: Fitter, winner: Fitted, base: Fitted) -> Fitted:
    """The model fitted to its minimum, with intervals.

    These cost several times as much as the fit, so they come last.

    Args:
        fitter: of the search.
        winner: a rough fit.
        base: from which gains count.
    """
    raw = fitter.raw
    if raw.unstable or raw.tick is None or raw.search.step == raw.step:
        return fitter.sharpened(winner, base)
    fitted = fitter.sharpened(winner, base, MINIMUM)
    return fitter.sharpened(_grounded(fitter, fitted, base), base)


def _grounded(fitter: Fitter, fitted: Fitted, base: Fitted) -> Fitted:
    """The model, with parameters from the rig's own step where they are better."""
    raw, noise = fitter.raw, 0.5 * fitted.estimate.count
    if fitted.estimate.cost < noise + EVIDENT * noise**0.5:
        return fitted
    measured = {run.name: run.data for run in raw.runs}
    problem = fitted.simulator.problem.with_data(measured).changed(step=raw.step)
    try:
        simulator = fitted.simulator.limited({}).of(problem.counting())
        fine = fit(simulator, fitted.estimate.theta, effort=STEPS)
    except CosimError as error:
        fitter.say(f"{fitted.effects[-1].label} could not be fitted at the rig's step: {error}")
        return fitted
    found = fitter.again(fitter.judged(fine), fitted, base)
    found = fitter.sharpened(found, base, MINIMUM)
    if fitter.total(base, found) <= fitter.total(base, fitted):
        return fitted
    fitter.say(f"{fitted.effects[-1].label}: a better minimum at the rig's own step")
    return found
