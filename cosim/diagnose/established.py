"""Whether a round's winner is established: its law by the data, and that it is there at all.

A bristle that gives way by nothing is dry friction, and a further effect may have come with better
start values of the runs, or beside moments that no model gets right.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import CosimError
from .candidates import Candidate
from .composed import composed
from .doubts import wanted
from .late_values import LateValueFitter
from .models import GATE, Fitted, compare
from .redundant import at_usual, without_redundant
from .rivals import challenged
from .rounds import Round
from .verdict import HAIR, TENTH

PART = 0.2
"""Share of what a model leaves beyond noise that a further effect must explain where runs may turn
unstable: moments that come too early are most of that, and any law moves them a little."""


def settle(search: LateValueFitter, base: Fitted, stage: Round) -> None:
    """Replace a winner by a simpler law where nothing else of it is determined.

    Before that, its further parameters are asked for again, and those that undo its strength held:
    drafts may have refused the ones for errors of the exchange, and taken the others as known.

    Args:
        search: fits and judges.
        base: model without the effect.
        stage: the round; its winner has intervals.
    """
    winner = stage.winner
    assert winner is not None and winner.signature is not None
    others = winner.signature.probe.others
    whole = winner
    if any(p.name not in winner.problem.names for p in others):
        whole = search.refined(base, winner, quick=True)
    plain = without_redundant(search, whole, others)
    if plain is not winner:
        winner = search.sharpened(plain, base)
        stage.follow(winner)
    winner = told_from_absence(search, base, winner, winner.effects[-1])
    stage.follow(winner)
    simple = _simpler(search, base, stage)
    if simple is winner:
        return
    search.say(f"{winner.effects[-1].label}: nothing of it but {simple.effects[-1].effect} shows")
    stage.winner = simple
    challenged(search, base, stage)  # its places have been compared by the other law only
    stage.follow(search.sharpened(stage.winner, base))


def told_from_absence(
    search: LateValueFitter, base: Fitted, fitted: Fitted, effect: Candidate
) -> Fitted:
    """A model, a strength's interval without absence where the data refuse a tenth of it.

    Intervals are as wide on either side. Where other parameters undo the strength along a bend (a
    light mass far away shifts the mass centre as a heavy one close by, but for its inertia), what
    is open above is not below. A tenth of a strength does a tenth of what the law did: what
    the verdict lets a model leave.

    Args:
        search: fits and judges.
        base: what gains on unused runs count from.
        fitted: with intervals.
        effect: of which the strength is asked.
    """
    if search.law(fitted, effect).there or search.lacking(fitted):
        return fitted  # beside what is missing, nats refuse too easily
    problem, estimate = fitted.problem, fitted.estimate
    strength = next(
        p for p in problem.parameters if p.strength and p.name.startswith(effect.prefix)
    )
    place = problem.index(strength.name)
    value = float(estimate.theta[place])
    faint = strength.absent + TENTH * (value - strength.absent)
    if estimate.identifiable[place] or not strength.minimum <= faint <= strength.maximum:
        return fitted
    less, known = search.held(fitted, strength.name, faint), search.memo.get(fitted.labels)
    if less is None:
        return fitted
    less.effects, less.signature = fitted.effects, fitted.signature
    less = search.approached(less, fitted, base)
    if known is not None:
        search.memo.keep(known)  # what holds the strength is no fit of the set
    if search.gain(less, fitted) <= GATE:
        return fitted
    low, high = estimate.low.copy(), estimate.high.copy()
    ends = low if faint < value else high
    ends[place] = faint
    search.say(f"{strength.name} = {faint:.3g} {strength.unit}: refused by the data")
    found = replace(fitted, estimate=replace(estimate, low=low, high=high))
    search.note(found)
    return found


def all_told(search: LateValueFitter, fitted: Fitted) -> Fitted:
    """A model each of whose strengths has been asked like that: a new fit has even intervals."""
    for effect in fitted.effects:
        fitted = told_from_absence(search, fitted, fitted, effect)
    return fitted


def _simpler(search: LateValueFitter, base: Fitted, stage: Round) -> Fitted:
    """The best simpler law of the same quantity, if nothing else of the winner is determined."""
    winner = stage.winner
    assert winner is not None and winner.signature is not None
    last, estimate = winner.effects[-1], winner.estimate
    strength = winner.signature.strength.name
    others = [
        (i, p) for i, p in enumerate(winner.problem.parameters)
        if p.name.startswith(last.prefix) and p.name != strength
    ]  # fmt: skip
    if not others or any(
        estimate.identifiable[i] and estimate.low[i] > p.minimum and estimate.high[i] < p.maximum
        for i, p in others
    ):
        return winner
    least = (1.0 - HAIR) * search.total(base, winner)
    laws = [
        f for f in stage.fitted
        if f.effects[-1].place == last.place and f.effects[-1] != last
        and f.quantity == winner.quantity != "" and f.complexity < winner.complexity
        and f.signature is not None  # fitted with fewer parameters, it may have more
        and f.signature.probe.own < winner.signature.probe.own
        and search.accepted(base, f) and search.total(base, f) > least
    ]  # fmt: skip
    return max(laws, key=lambda f: search.total(base, f), default=winner)


def needed(search: LateValueFitter, base: Fitted, stage: Round) -> None:
    """Take a further effect back that the model from where it ended does as well without.

    Only where runs may turn unstable. The round then has no winner, and perhaps a better base.

    Args:
        search: fits and judges.
        base: model without the effect.
        stage: the round.
    """
    winner = stage.winner
    assert winner is not None
    if not base.effects or not search.raw.unstable:
        return
    last = winner.effects[-1]
    try:
        less = search.approached(search.without(winner, last), winner, base)
    except CosimError as error:  # it is needed
        search.say(f"without {last.label}: {error}")
        return
    gate = compare(search.check_data, less.check, winner.check, search.checking)
    gain, beyond = search.gain(less, winner), less.estimate.robust - 0.5 * less.estimate.count
    if gate.passed and gain > max(GATE, PART * beyond):
        return
    search.say(f"{last.label} is not needed: {gain:.0f} nats, {gate.gain:.0f} on validation")
    stage.winner = None
    if search.gain(base, less) > GATE:
        found = search.sharpened(less, base)
        found.effects, found.signature = base.effects, base.signature
        found.gate = base.gate
        stage.base = found


def examined(search: LateValueFitter, fitted: Fitted, candidates: int) -> Fitted:
    """The model without effects that may be absent, or that unused runs do not miss.

    What it is without each of the others has been fitted, and is in the memo.

    Args:
        search: fits and judges.
        fitted: the model, with intervals.
        candidates: number of effects that there were to choose from.
    """

    def missed(effect: Candidate) -> bool:
        law = search.law(fitted, effect)
        return law.there and wanted(law.missed, candidates)

    if len(fitted.effects) < 2:
        return fitted
    fitted = all_told(search, fitted)
    for effect in fitted.effects:
        try:
            less = search.without(fitted, effect)
        except CosimError as error:  # it is needed
            search.say(f"without {effect.label}: {error}")
            search.memo.failed.add(fitted.labels - {effect.label})
            continue
        if missed(effect):
            less = search.approached(less, fitted, fitted)
        if missed(effect):
            less = freed(search, less, fitted)
        if not missed(effect):
            search.say(f"dropped again: {effect.label}")
            return examined(search, search.sharpened(less, fitted), candidates)
    return fitted


def freed(search: LateValueFitter, less: Fitted, fitted: Fitted) -> Fitted:
    """A model with all parameters of its effects, from where one with a further effect ended.

    A payload that stands aside is a payload in the middle and a shift of the load: parameters that
    nothing asked for beside the one law are what does the work of the other.

    Args:
        search: fits and judges.
        less: the model as it is.
        fitted: with the further effect.
    """
    try:
        problem = composed(search.raw, fitted, less.effects)
        whole = composed(search.raw, fitted, ())
        for effect in less.effects:
            whole = effect.added_to(whole)
    except CosimError as error:  # a law on what the further effect brings (a shaft that yields)
        search.say(f"{', '.join(sorted(less.labels))} alone: {error}")
        return less
    held = [p for p in whole.parameters if p.name not in problem.names]
    if not held:
        return less
    values = {**problem.held, **fitted.estimate.values}
    spans = {p.name: p.span for p in problem.parameters}
    whole = whole.with_parameters(
        [replace(p, span=spans.get(p.name, p.span)) for p in whole.parameters]
    )
    theta = np.array([values.get(name, p.nominal) for name, p in zip(
        whole.names, whole.parameters, strict=True)])  # fmt: skip
    try:
        found = search.fitted(search.simulator.of(whole), theta, fitted.estimate)
    except CosimError as error:
        search.say(f"with {', '.join(p.name for p in held)}: {error}")
        return less
    found.effects, found.signature = less.effects, less.signature
    found = search.approached(found, fitted, fitted)
    if search.gain(less, found) <= GATE:
        return less
    found = at_usual(search, found, {p.name: values.get(p.name, p.nominal) for p in held})
    more = [p.name for p in held if p.name in found.estimate.values]
    search.say(f"{', '.join(more) or 'other values'} instead of a further effect")
    search.note(found)
    return found
