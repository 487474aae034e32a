"""Rivals of a winner that leaves far more than noise, with the parameters that their laws lack."""

from __future__ import annotations

from .fitter import Fitter
from .models import Fitted, is_open
from .rounds import Round

COMPLETED = 2
"""Rivals that are completed at most, the best: each costs a fit with more parameters than a quick
one, and which of many laws comes next is left to the next round."""


def completed(fitter: Fitter, base: Fitted, stage: Round) -> None:
    """Fit near rivals of a round's winner with their other parameters; one may take its place.

    Quick fits hold them. A law that does nearly as well as the winner without them may be the right
    one: a cable pulls as gravity does on a slope but for where it is fixed.

    Args:
        fitter: fits and judges.
        base: model without the effect.
        stage: the round, whose winner has all of its own.
    """
    best = winner = stage.winner
    assert best is not None
    near = [f for f in stage.fitted if f.effects[-1] in stage.near and _held(f, best)]
    for rival in near[:COMPLETED]:
        found = fitter.refined(base, rival, quick=True)
        stage.fitted = [found if f is rival else f for f in stage.fitted]
        if fitter.total(base, found) > fitter.total(base, best) and fitter.accepted(base, found):
            best = found
    if best is not winner:
        fitter.say(f"{best.effects[-1].label} does better with its other parameters")
        better = fitter.sharpened(best, base, draft=True)
        if is_open(better.estimate):  # a rough fit may have held what it could not tell
            better = fitter.refined(base, better)
        stage.fitted = [better if f is best else f for f in stage.fitted]
        stage.winner, stage.open = better, is_open(better.estimate)


def _held(fitted: Fitted, winner: Fitted) -> bool:
    """Whether another law than the winner's has parameters that are held."""
    last = fitted.effects[-1]
    held = any(name.startswith(last.prefix) for name in fitted.problem.constants)
    return last != winner.effects[-1] and held
