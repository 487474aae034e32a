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
from .whiteness import UNNAMED, whiteness_tests

if TYPE_CHECKING:
    from .fitter import Fitter

EVIDENT = 3.0
"""Deviations by which the cost exceeds that of noise: half a sum of n squares varies by
sqrt(n / 2)."""
STEPS = Effort("near", "draft", iterations=4)
"""Each costs as many simulations as there are parameters, at a step that is ten times as fine."""


def grounded(fitter: Fitter, winner: Fitted, base: Fitted) -> Fitted:
    """The model, with parameters from the rig's own step where they are better.

    Args:
        fitter: of the search.
        winner: a thorough fit.
        base: from which gains count.
    """
    raw = fitter.raw
    coarse = raw.tick is not None and raw.search.step != raw.step
    if not coarse or raw.unstable or not _leaves(fitter, winner):
        return winner
    measured = {run.name: run.data for run in raw.runs}
    problem = winner.simulator.problem.with_data(measured).changed(step=raw.step)
    try:
        simulator = winner.simulator.limited({}).of(problem.counting())
        fine = fit(simulator, winner.estimate.theta, effort=STEPS)
    except CosimError as error:
        fitter.say(f"{winner.effects[-1].label} could not be fitted at the rig's step: {error}")
        return winner
    found = fitter.again(fitter.judged(fine), winner, base)
    found = fitter.sharpened(found, base, MINIMUM)  # intervals take several times as long
    if fitter.total(base, found) <= fitter.total(base, winner):
        return winner
    fitter.say(f"{winner.effects[-1].label}: a better minimum at the rig's own step")
    return fitter.sharpened(found, base)


def _leaves(fitter: Fitter, winner: Fitted) -> bool:
    """Whether a model leaves more than noise: in all, or by the tests of a verdict.

    What a coarse step has moved is small in the sum over all channels, and slow in one of them.
    """
    noise = 0.5 * winner.estimate.count
    if winner.estimate.cost > noise + EVIDENT * noise**0.5 or fitter.lacking(winner):
        return True
    unused = whiteness_tests(fitter.beside(winner), fitter.checking) if fitter.unused else []
    return any(item.structured or item.slow > UNNAMED for item in unused)
