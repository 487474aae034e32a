"""Quick fits that hold what a law has, of which first orders say little, with that free."""

from __future__ import annotations

from ..calibrate.fit import DRAFT
from .fitter import BRINGS, Fitter
from .judge import OFF
from .models import GATE, Fitted, is_open
from .rivals import NEARLY
from .rounds import Round

COMPLETED = 2
"""Laws that are completed at most, the best: each costs a fit with more parameters than a quick
one, and which of many laws comes next is left to the next round."""
TURNS = 4
"""Times at most that one is fitted so: with derivatives of the one before, and with its own."""


def freed(fitter: Fitter, stage: Round, fitted: Fitted) -> Fitted:
    """A law that was tried at a few places, fitted with its place free where the model is far off.

    There first orders do not lead to the right one, so that its quick fit says nothing of the law:
    a slippery patch beside where it lies does worse than a slope.

    Args:
        fitter: fits and judges.
        stage: the round, with the laws that were fitted before.
        fitted: a quick fit; the better one among those that hold as much come first.
    """
    before = sum(f.signature is not None and f.signature.placed for f in stage.fitted)
    placed = fitted.signature is not None and fitted.signature.placed
    if not placed or before >= COMPLETED or not fitter.typical(stage.base) > OFF:
        return fitted
    return _whole(fitter, stage.base, fitted)


def completed(fitter: Fitter, base: Fitted, stage: Round) -> None:
    """Fit near rivals of a round's winner with their other parameters; one may take its place.

    Quick fits hold them. A law that does nearly as well as the best one without them, in all runs
    or in those that were fitted, may be the right one: a cable pulls as gravity does on a slope but
    for where it is fixed. Unused runs speak of the law only once nothing of it is held.

    Args:
        fitter: fits and judges.
        base: model without the effect.
        stage: the round, whose winner has all of its own.
    """
    best = winner = stage.winner
    assert best is not None
    least = NEARLY * max(fitter.gain(base, f) for f in stage.fitted)
    near = [
        f for f in stage.fitted
        if _held(f, best) and (f.effects[-1] in stage.near or fitter.gain(base, f) > least)
    ]  # fmt: skip
    for rival in near[:COMPLETED]:
        found = _whole(fitter, base, rival)
        stage.fitted = [found if f is rival else f for f in stage.fitted]
        if fitter.total(base, found) > fitter.total(base, best) and fitter.accepted(base, found):
            best = found
    if best is not winner:
        fitter.say(f"{best.effects[-1].label} does better with its other parameters")
        stage.winner, stage.open = best, is_open(best.estimate)


def _whole(fitter: Fitter, base: Fitted, fitted: Fitted) -> Fitted:
    """A law fitted with all its parameters, as long as a turn brings a tenth of what is left."""
    for _ in range(TURNS):
        found = fitter.refined(base, fitted, quick=True)
        if found is fitted:
            break
        found = fitter.sharpened(found, base, DRAFT)
        beyond = found.estimate.robust - 0.5 * found.estimate.count
        going = fitter.gain(fitted, found) > max(BRINGS * beyond, GATE)
        fitted = found
        if not going:
            break
    return fitted


def _held(fitted: Fitted, winner: Fitted) -> bool:
    """Whether another law than the winner's has parameters that are held."""
    last = fitted.effects[-1]
    held = any(name.startswith(last.prefix) for name in fitted.problem.held)
    return last != winner.effects[-1] and held
