"""One law in the place of another: how winners are compared with what may do as well.

    challenged     at the end of a round, its winner: simpler laws, its law elsewhere, close ones
    reconsidered   after later rounds, the winners of earlier ones in the model with all effects
    simplified     before the verdict, each law of a set with its special cases
    elsewhere      likewise, the same law where it does nothing of its own beside the set's

Where several effects are missing, a round ends far from the noise whichever of them it adds, and
rivals of the added one are not told apart by models that lack the rest. With the rest added they
are: each rival takes the effect's place in the last model, is refitted, and stays if it is better.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..calibrate.fit import DRAFT
from ..calibrate.problem import Problem
from ..errors import CosimError
from .candidates import Candidate, new_parameters
from .composed import composed
from .fitter import QUICKLY
from .late_values import LateValueFitter
from .levelled import CLOSE, to_minimum
from .models import GATE, Fitted, compare, more_general
from .probes import single
from .rounds import Round
from .shortlist import kin
from .signature import HIDDEN, Signature, unscored
from .sticking import sharper

Vector = NDArray[np.float64]
NEARLY = 0.8
"""Rivals gained this share of what the best one did; their fits were rough."""
HOPEFUL = 0.5
"""A law that gains less than this share of what the winner does, from the winner's parameters, is
not fitted further."""
NEAR = 0.98
"""Late values, which were estimated for the winner, are estimated again for a law that gains this
share of what the winner does."""
CHANGED = 0.01
"""Share of what the best quick fit gained by which a challenger must be better for all others to be
fitted from its parameters again."""
TENTHS = 4
"""Powers of a tenth of a law's usual smoothing that are tried, the first being 1."""
OTHERS = 2
"""Laws that do nearly what the winner does elsewhere, which are fitted as far as it."""
MOST = 3
"""Rivals that are tried at most, besides places where to first order the same happens: each costs a
fit, as the winner did."""


def nearly(search: LateValueFitter, base: Fitted, stage: Round) -> frozenset[Candidate]:
    """Candidates whose fits gain nearly as much as the best quick one did.

    Of those that stand at one of a few values that were tried, the first order counts as well: a
    quick fit holds them there.
    """
    least = NEARLY * stage.quick
    gains = {f.effects[-1]: f.signature.score.gain for f in stage.fitted if f.signature is not None}
    promised = NEARLY * max(gains.values(), default=0.0)
    return frozenset(
        f.effects[-1] for f in stage.fitted
        if search.total(base, f) > least
        or (f.signature is not None and f.signature.placed and gains[f.effects[-1]] > promised)
    )  # fmt: skip


def reconsidered(search: LateValueFitter, fitted: Fitted, rounds: list[Round]) -> Fitted:
    """The model with early choices exchanged where that is better.

    Rounds get the winner that the last model shows. One that was not open is asked
    again only where later effects have joined its own: beside what lacked these, a law with more
    parameters had made up for them.

    Args:
        search: judges.
        fitted: model with all effects.
        rounds: those that found them.
    """
    for stage in rounds:
        if stage.winner is None or stage.cut:
            continue
        effects = frozenset(fitted.effects)
        if not stage.open and effects <= (stage.compared or set(stage.winner.effects)):
            continue
        if stage.winner.effects[-1] not in effects:
            continue
        present = _seen_last(fitted, stage.winner)
        trials: list[tuple[Fitted, Fitted | None]] = []
        for item, known in _others(search, stage):
            if item.candidate in fitted.effects:
                continue
            try:
                trial = exchanged(search, present, item, known)
            except CosimError as error:
                search.say(f"{item.candidate.label} instead: {error}")
                continue
            gain = search.total(present, trial)
            search.say(f"{item.candidate.label} instead: {gain:.0f} nats on all runs")
            trials.append((trial, known))
        for trial, known in _told_apart(search, present, stage.base, trials):
            gain, unused = search.gains(present, trial)
            alike = not search.apart(present, trial)
            simpler = alike and (more_general(present, trial) or _wider(present, trial))
            if simpler or (not alike and gain > GATE and unused > 0.0):
                present, stage.winner = trial, known or trial
        if present.estimate is not fitted.estimate:
            fitted = search.sharpened(present, stage.base)
        stage.compared = frozenset(fitted.effects)
    return fitted


def simplified(search: LateValueFitter, fitted: Fitted, known: Sequence[Candidate]) -> None:
    """Fit a set with the special case of each of its laws instead, from where its own fit ended.

    The memo gets the fits, and the verdict decides. A special case that had its turn before the
    rest of the set was known has a fit that ended elsewhere, which tells laws apart that the data
    do not.

    Args:
        search: fits and judges.
        fitted: the set, thoroughly fitted.
        known: all candidates.
    """
    for effect in fitted.effects:
        rest = tuple(e for e in fitted.effects if e != effect)
        present = replace(fitted, effects=(*rest, effect), signature=None)
        for candidate in known:
            if candidate.place != effect.place or candidate.effect not in effect.contains:
                continue
            try:
                less = composed(search.raw, fitted, rest)
                for probe in single(less, [candidate]):
                    trial = exchanged(search, present, unscored(probe), None, less, share=0.0)
                    trial = search.approached(trial, present, fitted)
                    gain = search.total(present, trial)
                    search.say(f"{candidate.label}, a special case: {gain:+.1f} nats on all runs")
            except CosimError as error:
                search.say(f"{candidate.label} instead: {error}")


def elsewhere(search: LateValueFitter, fitted: Fitted, rounds: Sequence[Round]) -> None:
    """Fit a set with each of its laws where, beside it, the same law does nothing of its own.

    A gain of one wheel is the inverse gain of the other one with another radius and track: beside
    either, calibration absorbs the other. Rounds that lacked further effects took them for two. The
    memo gets the fits, and the verdict decides.

    Args:
        search: fits and judges.
        fitted: the set, thoroughly fitted.
        rounds: that found it, or one that asks beside it; that one is of all places.
    """
    declared = search.memo.declared
    least = HOPEFUL * search.total(declared, fitted)
    for effect in fitted.effects:
        hidden = {
            s.candidate: s
            for stage in rounds if effect in stage.base.effects
            for s in stage.signatures
            if s.candidate.effect == effect.effect
            and (s.candidate.instance == effect.instance or stage.base is fitted)
            and s.candidate not in fitted.effects
            and s.absorbed > HIDDEN and s.score.size > 0.0
        }  # fmt: skip
        rest = tuple(e for e in fitted.effects if e != effect)
        present = replace(fitted, effects=(*rest, effect), signature=None)
        for candidate, item in hidden.items():
            if search.memo.get(frozenset([*(e.label for e in rest), candidate.label])) is not None:
                continue
            try:
                less = composed(search.raw, fitted, rest)
                same = replace(unscored(item.probe), second=item.second, fixed=item.fixed)
                trial = exchanged(search, present, same, None, less, share=0.0)
                if search.total(declared, trial) > least:
                    trial = search.approached(trial, present, fitted)
            except CosimError as error:
                search.say(f"{candidate.label} instead: {error}")
                continue
            gain = search.total(present, trial)
            search.say(f"{candidate.label}, the same elsewhere: {gain:+.1f} nats on all runs")


def _wider(first: Fitted, second: Fitted) -> bool:
    """Whether a law of the same quantity at the same place has more parameters, fitted or held.

    How sharply a law sticks, held at another value than usual, makes no law of a simpler one.
    """
    if first.signature is None or second.signature is None or not first.quantity:
        return False
    return (
        first.effects[-1].place == second.effects[-1].place
        and first.quantity == second.quantity
        and first.signature.probe.own > second.signature.probe.own
    )


def _told_apart(
    search: LateValueFitter,
    present: Fitted,
    base: Fitted,
    trials: list[tuple[Fitted, Fitted | None]],
) -> list[tuple[Fitted, Fitted | None]]:
    """Models that could take another's place, the best first, thoroughly fitted if they are near.

    Args:
        search: fits and judges.
        present: the model that they could replace.
        base: model without the effect.
        trials: quick fits, with those of the round.
    """
    gains = [search.total(present, trial) for trial, _ in trials]
    most = max(gains, default=0.0)
    order = np.argsort(gains, kind="stable")[::-1].tolist()
    near = [i for i in order if gains[i] > max(NEARLY * most, GATE)][:MOST]
    found = [trials[i] for i in order]
    for place, i in enumerate(near if near[1:] else []):
        trial, known = trials[i]
        found[place] = search.sharpened(trial, base, DRAFT), known
    return sorted(found, key=lambda pair: -search.total(present, pair[0]))


def challenged(search: LateValueFitter, base: Fitted, stage: Round) -> Fitted:
    """The winner of a round, or its effect elsewhere or another law, if that does as well.

    Fits that end at different distances from their minima would tell laws apart that are one; so
    all of these are fitted from where the winner's parameters are, down to `descent.SETTLED`.

    Args:
        search: fits and judges.
        base: model without the effect.
        stage: the round; the new fits take their places in it.
    """
    settled: dict[Candidate, Fitted] = {}
    winner = stage.winner
    assert winner is not None
    while others := _alike(search, base, stage, set(settled)):
        if not settled:
            first = winner
            close = search.fitted(first.simulator, first.estimate.theta, first.estimate, share=0.0)
            winner = search.again(close, first, base)
            stage.fitted = [winner if f is first else f for f in stage.fitted]
            settled[winner.effects[-1]] = winner
        last, simple = winner.effects[-1], False
        for item, known in others:
            law = item.candidate.effect != last.effect and (
                item.candidate.place == last.place
                or (known is not None and more_general(winner, known))
            )
            if law and simple:
                continue  # more general than one that does as well
            try:
                # without the winner's effect, and with its late values
                less = base.problem.changed(runs=winner.problem.runs)
                trial = exchanged(search, winner, item, known, less, share=0.0)
            except CosimError as error:
                search.say(f"{item.candidate.label} instead: {error}")
                continue
            trial.gate = compare(search.check_data, base.check, trial.check, search.checking)
            if search.total(base, trial) > HOPEFUL * search.total(base, winner):
                trial = search.refined(base, trial, quick=True, share=0.0)
                almost = search.total(base, trial) > CLOSE * search.total(base, winner)
                if almost and item.candidate.effect != last.effect and not search.raw.unstable:
                    trial = to_minimum(search, trial, winner, base)
                else:
                    trial = search.approached(trial, winner, base)
            else:
                law = False
            if item.placed and search.total(base, trial) > CLOSE * search.total(base, winner):
                # elsewhere its mass, say, is another one, and with it what the exchange adds
                trial = search.sharpened(trial, base, DRAFT)
            near = search.total(base, trial) > NEAR * search.total(base, winner)
            if law and near and (late := search.released(trial, base)) is not trial:
                trial = search.refined(base, late, quick=True, share=0.0)
            simple |= law and not (
                search.gain(trial, winner) > GATE and search.apart(trial, winner)
            )
            more = search.total(base, trial) - search.total(base, winner)
            search.say(f"{item.candidate.label} instead: {more:+.1f} nats on all runs")
            stage.fitted = [f for f in stage.fitted if f is not known] + [trial]
            settled[item.candidate] = trial
        stage.fitted.sort(key=lambda f: -search.total(base, f))
        mine = sorted(settled.values(), key=lambda f: -search.total(base, f))
        best = search.chosen(base, mine) or winner
        stage.winner = best
        if best is winner:
            break
        if search.total(base, best) - search.total(base, winner) > CHANGED * stage.quick:
            settled = {best.effects[-1]: best}  # others were fitted from a poor place
        winner = best  # its places and simpler laws have not been compared yet
    return winner


def _alike(
    search: LateValueFitter, base: Fitted, stage: Round, known: set[Candidate]
) -> list[tuple[Signature, Fitted | None]]:
    """The winner's effect at other places, simpler laws at its own, close ones elsewhere.

    But for known ones; by their number of parameters.
    """
    winner = stage.winner
    assert winner is not None and winner.signature is not None
    name = winner.effects[-1].effect
    near = nearly(search, base, stage) | stage.near  # residuals may count in another way since
    found: list[tuple[Signature, Fitted | None]] = [
        (f.signature, f) for f in stage.fitted
        if f is not winner and f.signature is not None and search.accepted(base, f)
        and f.effects[-1] in near
        and (f.effects[-1].effect == name or (
            more_general(winner, f) and f.signature.probe.own <= winner.signature.probe.own
        ))  # fitted with fewer parameters, a law that has more of them is no simpler one
    ]  # fmt: skip
    fitted = {f.effects[-1]: f for f in stage.fitted}
    found += [(t, None) for t in kin(search, base, stage) if t.candidate not in fitted]
    found += _simpler(stage)
    # another law that does nearly as well elsewhere has not been fitted as far, so unused runs may
    # want it yet; one with more parameters makes up by them for what a limit does, and lacks what
    # is held of its place
    least = CLOSE * search.gain(base, winner)
    found += [
        (f.signature, f) for f in stage.fitted
        if f.signature is not None and f.effects[-1].effect != name and f.effects[-1] in near
        and f.effects[-1].place != winner.effects[-1].place
        and (f.signature.placed or (f.signature.probe.own <= winner.signature.probe.own
                                    and search.gain(base, f) > least))
    ][:OTHERS]  # fmt: skip
    unique = {item.candidate: (item, f) for item, f in reversed(found)}
    return sorted(
        (pair for candidate, pair in unique.items() if candidate not in known),
        key=lambda pair: pair[0].probe.own,
    )


def _seen_last(fitted: Fitted, winner: Fitted) -> Fitted:
    """A model as if the effect of an earlier round had been added last."""
    last = winner.effects[-1]
    rest = [e for e in fitted.effects if e != last]
    return replace(fitted, effects=(*rest, last), signature=winner.signature)


def _others(search: LateValueFitter, stage: Round) -> list[tuple[Signature, Fitted | None]]:
    """Rivals of a round's winner with their quick fits, and its twins elsewhere."""
    winner = stage.winner
    assert winner is not None
    close = nearly(search, stage.base, stage) | stage.near
    near = [
        f for f in stage.fitted
        if f.effects[-1] != winner.effects[-1] and f.signature is not None
        and search.accepted(stage.base, f) and f.effects[-1] in close
    ]  # fmt: skip
    met = {winner.effects[-1].effect}
    first: list[Fitted] = []
    for f in near:  # another law differs more than the same one elsewhere
        if f.effects[-1].effect not in met:
            met.add(f.effects[-1].effect)
            first.append(f)
    again = {id(f) for f in first}
    near = (first + [f for f in near if id(f) not in again])[:MOST]
    found: list[tuple[Signature, Fitted | None]] = [
        (f.signature, f) for f in near if f.signature is not None
    ]
    found += [(twin, None) for twin in kin(search, stage.base, stage)]
    known = {item.candidate for item, _ in found}
    return found + [pair for pair in _simpler(stage) if pair[0].candidate not in known]


def _simpler(stage: Round) -> list[tuple[Signature, Fitted | None]]:
    """Simpler laws at the winner's place, with their fits where there are any."""
    fitted = {f.effects[-1]: f for f in stage.fitted}
    return [(item, fitted.get(item.candidate)) for item in stage.simpler()]


def exchanged(
    search: LateValueFitter,
    fitted: Fitted,
    item: Signature,
    known: Fitted | None,
    less: Problem | None = None,
    *,
    share: float = QUICKLY,
) -> Fitted:
    """A model with another effect instead of its last one, quickly refitted.

    Args:
        search: fits and judges.
        fitted: the model.
        item: what comes instead.
        known: a fit of that, for the values to begin with.
        less: the problem without the last effect, if it is at hand.
        share: see `Effort`.

    Raises:
        CosimError: it cannot be simulated.
    """
    less = less or composed(search.raw, fitted, fitted.effects[:-1])
    whole = item.candidate.added_to(less)
    strengths, others = new_parameters(less, whole)
    names = {p.name for p in (*strengths, *others)}
    values = {item.strength.name: item.value * (item.score.amplitude or 1.0)}
    if item.probe.second:
        values[item.probe.second] = item.second
    if known is not None:
        values = {n: v for n, v in known.estimate.values.items() if n in names}
    held: dict[str, float] = {}
    if fitted.effects[-1].place == item.candidate.place:  # the same quantities
        old, new = fitted.effects[-1].prefix, item.candidate.prefix
        mine = {n.removeprefix(old): v for n, v in fitted.estimate.values.items()}
        values |= {n: mine[n.removeprefix(new)] for n in names if n.removeprefix(new) in mine}
        mine = {n.removeprefix(old): v for n, v in fitted.problem.held.items()}
        held = {n: mine[n.removeprefix(new)] for n in names if n.removeprefix(new) in mine}
    fixed = {
        p.name: item.fixed.get(p.name, held.get(p.name, p.nominal))
        for p in others if p.name not in values
    }  # fmt: skip
    whole = whole.with_parameters(
        [replace(p, span=abs(values[p.name]) or p.span) if p.strength and p.name in values else p
         for p in whole.parameters]
    )  # fmt: skip
    known_values = {**fitted.estimate.values, **values}
    if fitted.effects[-1].place == item.candidate.place:
        fixed = _sharpest(search, whole, known_values, fixed)
    problem, start = _begun(whole, known_values, fixed)
    result = search.fitted(search.simulator.of(problem), start, fitted.estimate, share=share)
    result.effects = (*fitted.effects[:-1], item.candidate)
    result.signature = item.at(fixed)
    search.note(result)
    return result


def restarted(
    search: LateValueFitter, fitted: Fitted, base: Fitted, simpler: list[Fitted]
) -> Fitted:
    """A model that is far off fitted from nominal values; from where a simpler law does better.

    Args:
        search: fits and judges.
        fitted: the model.
        base: model without its last effect.
        simpler: models with laws that the last effect contains, fitted so.
    """
    near = min(simpler, key=lambda f: f.estimate.robust, default=fitted)
    if fitted.signature is None or not near.estimate.robust < fitted.estimate.robust - GATE:
        return sharper(search, search.retried(fitted, base), base)
    name = fitted.effects[-1].label
    try:
        less = base.problem.changed(runs=near.problem.runs)
        found = exchanged(search, near, fitted.signature, fitted, less)
    except CosimError as error:
        search.say(f"{name} from {near.effects[-1].label}: {error}")
        return fitted
    if not found.estimate.robust < near.estimate.robust - GATE:
        return fitted
    search.say(f"{name}: a better minimum from {near.effects[-1].label}")
    found.gate = compare(search.check_data, base.check, found.check, search.checking)
    return found


def _begun(
    whole: Problem, values: dict[str, float], fixed: dict[str, float]
) -> tuple[Problem, Vector]:
    """A problem with some parameters held, and the values of the others."""
    problem = whole.hold(fixed)
    theta = problem.nominal
    for name, value in values.items():
        if name in problem.names:
            theta[problem.index(name)] = value
    return problem, theta.clip(problem.lower, problem.upper)


def _sharpest(
    search: LateValueFitter, whole: Problem, values: dict[str, float], fixed: dict[str, float]
) -> dict[str, float]:
    """Held parameters with those that smooth a law as small as the data want them.

    A law that creeps at rest is far off where the one before it sticks, and derivatives there do
    not lead to where it hardly creeps.
    """
    for p in whole.parameters:
        if p.name not in fixed or not p.minimum > 0.0:
            continue
        best = math.inf
        for power in range(TENTHS):
            trial = {**fixed, p.name: max(fixed[p.name] * 0.1**power, p.minimum)}
            try:
                problem, theta = _begun(whole, values, trial)
                cost = search.cost(search.simulator.of(problem), theta)
            except CosimError:
                break
            if not cost < best:
                break
            best, kept = cost, trial
        fixed = kept if best < math.inf else fixed
    return fixed
