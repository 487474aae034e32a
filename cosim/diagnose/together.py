"""Sets of effects, proposed by their evidence along the log's motion and fitted.

Rounds add one effect after another, and each is judged by a model that lacks the others. Where that
ends far from the noise, the model is moved along the log (`following`), the laws of the catalogue
are asked there what they would do (`directions`), and the sets that explain most together
(`evidence`) are fitted from the values that they have there, without efforts. Then once more from
the parameters that the best of them ended with, if it is better than what rounds have found.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..calibrate.deferred import corrected
from ..calibrate.fit import DRAFT, Effort, fit
from ..calibrate.problem import Problem
from ..errors import CosimError, UnbuiltError
from .candidates import balances, candidates, new_parameters
from .choices import APART
from .directions import Direction, Responses
from .evidence import ALIKE, Chosen, Evidence
from .fitter import AGAIN, BRINGS, QUICKLY
from .following import follow
from .judge import OFF
from .localise import Place
from .models import GATE, Fitted, compare
from .search import Search
from .secant import patience
from .signature import unscored
from .verdict import HALF

Vector = NDArray[np.float64]
FITS, VARIANTS = (2, 4, 4, 3), 6
"""Families of sets of one law, of two, ... whose simplest member is fitted, and other members of
the best family that are: first orders leave errors of a per cent, within which a law and what is
nearly it (friction, friction that falls with speed) change places."""
TURNS = 2
"""Times that sets are proposed, the second time with the parameters of a better set."""
AHEAD = 1000
"""Laws times runs up to which sets are compared before the rounds: a round simulates about as many
runs. A motor has some 400, an arm and a base with arm 1400 and more, of ten times the cost each."""
BEYOND = 0.02
"""Share of what a model leaves beyond noise that a better set must take from it."""
ROUGHLY = Effort("near", "draft", share=QUICKLY)
"""From values that are near until little is gained: one that ends early looks like a wrong set."""


@dataclass(frozen=True, eq=False)
class Draft:
    """A fit of a set.

    Attributes:
        fitted: it.
        whole: the problem with all parameters of its laws.
        held: those that are held -> value.
    """

    fitted: Fitted
    whole: Problem
    held: dict[str, float]

    @property
    def counted(self) -> dict[str, float]:
        """Those of them that are no sizes: cycles per turn, places, multiples of a sample."""
        hints = {p.name: p.hints for p in self.whole.parameters}
        return {
            n: v for n, v in self.held.items()
            if hints[n].cycles or hints[n].visits or hints[n].tries or hints[n].lattice
        }  # fmt: skip


def ahead(search: Search) -> bool:
    """Whether sets are compared before the rounds end, after one that took less than half.

    All laws are simulated in all fitted runs for that. Where these are many, rounds go on first,
    and sets are only compared if they end with more than noise.
    """
    return len(search.known) * len(search.fitting.runs) <= AHEAD


def together(
    search: Search, current: Fitted, located: Sequence[Place], only: Sequence[str] = ()
) -> Fitted:
    """The best set of effects that is found so; the given model, if none is better.

    Args:
        search: the data, and fits so far; gets those that are made here.
        current: the best model of the rounds.
        located: where a free force explains most, first.
        only: places whose laws are asked, as candidates name them; all if not given.
    """
    declared = search.memo.declared
    among = [] if only else sorted(balances(declared.problem))
    places = [(p.instance, p.port) for p in located if p.evidence > 0.0]
    if not places or search.raw.late:
        return current
    best = current
    for _ in range(TURNS):
        theta = _declared(declared, best)
        try:
            followed = follow(declared.simulator, theta, search.fitting, places[0], among)
            names = ", ".join(followed.places)
            search.say(f"along the log by efforts at {names}: mean square {followed.left:.3g}")
            if followed.left > OFF:
                search.say("that is not the log's motion: first orders would mislead")
                break
            responses = Responses(followed, search.fitting)
            known = search.offered(candidates(declared.problem))
            known = [c for c in known if not only or c.place in only]
            directions = responses.of(known)
        except UnbuiltError:
            raise
        except CosimError as error:
            search.say(f"the model cannot be moved along the log: {error}")
            break
        found = _fitted(search, declared, responses, directions)
        draft = max(found, key=lambda d: _total(search, declared, d.fitted), default=None)
        if draft is None:
            break
        settled, before = _settled(search, declared, draft), best
        gained = _total(search, declared, settled) - _total(search, declared, best)
        if gained > max(GATE, BEYOND * (best.estimate.robust - 0.5 * best.estimate.count)):
            best = settled
            search.say(f"together: {', '.join(sorted(best.labels))}")
        if best is before or not search.lacking(best):
            break
    return best


def _settled(search: Search, declared: Fitted, draft: Draft) -> Fitted:
    """The set fitted until nothing is gained, what the search's step adds taken off at each end.

    At last with all of its other parameters that may take any value, if fitted runs want that.
    """
    fitted = draft.fitted
    for _ in range(AGAIN):
        near = search.sharpened(fitted, declared, DRAFT)
        gained = search.gains(fitted, near)[0]
        fitted = near if gained > 0.0 else fitted
        if gained <= GATE:
            break
    found = _again(search, Draft(fitted, draft.whole, draft.held), draft.counted, DRAFT)
    if found is not None and search.freer(fitted, found.fitted):
        fitted = found.fitted
    return search.sharpened(fitted, declared)


def _declared(declared: Fitted, fitted: Fitted) -> Vector:
    """Values that the declared parameters have in a model."""
    values = {**declared.estimate.values, **fitted.estimate.values}
    return np.array([values[name] for name in declared.problem.names])


def _total(search: Search, declared: Fitted, fitted: Fitted) -> float:
    return search.gains(declared, fitted)[0] if fitted is not declared else 0.0


def _fitted(
    search: Search, declared: Fitted, responses: Responses, directions: Sequence[Direction]
) -> list[Draft]:
    """The best sets of each size, fitted; larger ones only where smaller leave more than noise."""
    evidence = Evidence(directions, responses.wanted)
    levels = evidence.sets(len(FITS))
    most = max((level[0].gain for level in levels if level), default=0.0)
    beyond = 0.5 * (float(responses.wanted @ responses.wanted) - responses.wanted.size)
    if most < HALF * beyond:
        search.say(f"no {len(FITS)} laws explain half of that: first orders would mislead")
        return []
    found: list[Draft] = []
    for few, level in zip(FITS, levels, strict=True):
        families = evidence.families(level)[:few]
        best: tuple[Draft, list[Chosen]] | None = None
        now: list[Draft] = []
        for first, *others in families:
            one = _fit(search, declared, responses, directions, first)
            if one is not None:
                now.append(one)
                if best is None or _total(search, declared, one.fitted) > _total(
                    search, declared, best[0].fitted
                ):
                    best = one, others
        if best is None or not _better(search, declared, best[0], found):
            found += now
            continue
        for chosen in best[1][:VARIANTS]:
            one = _fit(search, declared, responses, directions, chosen)
            if one is not None:
                now.append(one)
        now.sort(key=lambda d: -_total(search, declared, d.fitted))
        most = _total(search, declared, now[0].fitted)  # below 0 if all explain nothing
        near = [d for d in now if _total(search, declared, d.fitted) >= most - ALIKE * abs(most)]
        simplest = min(near, key=lambda d: len(d.whole.parameters))
        for one in now:  # how sharply a law sticks may be what another has parameters for
            better = one in (now[0], simplest)
            found.append(_shaped(search, declared, one) if better else one)
        if any(not search.lacking(d.fitted) for d in found):
            break
    return found


def _better(search: Search, declared: Fitted, one: Draft, found: Sequence[Draft]) -> bool:
    """Whether a set explains more than all smaller ones, and much of what these leave."""
    before = [declared, *(d.fitted for d in found)]
    best = max(before, key=lambda f: _total(search, declared, f))
    beyond = best.estimate.robust - 0.5 * best.estimate.count
    return (
        _total(search, declared, one.fitted) > _total(search, declared, best)
        and search.gain(best, one.fitted) > BRINGS * beyond
    )


def _fit(
    search: Search,
    declared: Fitted,
    responses: Responses,
    directions: Sequence[Direction],
    chosen: Chosen,
) -> Draft | None:
    """A set fitted from the values that it has along the log's motion."""
    members = [directions[m] for m in chosen.members]
    name = ", ".join(d.candidate.label for d in members)
    problem = declared.problem
    values: dict[str, float] = {}
    held: dict[str, float] = {}
    left = responses.followed.wanted.copy()
    for one, factors in zip(members, chosen.values, strict=True):
        values |= one.parameters(factors)
        left -= one.change.astype(np.float64) @ factors
    try:
        for one in members:
            less, problem = problem, one.candidate.added_to(problem)
            _, others = new_parameters(less, problem)
            open_ = {one.probe.second, *(p.name for p in others if p.hints.decades)}
            held |= {
                p.name: values.get(p.name, p.nominal)
                for p in others
                if p.name not in values or p.name not in open_
            }
        problem = _spanned(problem, values)
        whole = problem
        problem = problem.hold(held)
        simulator = declared.simulator.of(problem).limited(patience(declared.simulator))
        shift = responses.absorber.change(left) * declared.problem.scale
        theta = responses.followed.theta
        points = (theta + shift, theta, declared.problem.nominal)
        starts = [_start(problem, point, values) for point in points]
        (_, begin), *_ = search.ranked(simulator, starts)
        result = search.judged(fit(simulator, begin, effort=ROUGHLY))
    except UnbuiltError:
        raise
    except CosimError as error:
        search.say(f"{name} could not be fitted: {error}")
        return None
    last = members[-1]
    result.effects = tuple(d.candidate for d in members)
    result.signature = replace(unscored(last.probe), fixed=dict(last.fixed))
    _note(search, declared, result)
    search.say(f"{name}: {_total(search, declared, result):.0f} nats on all runs")
    return Draft(result, whole, held)


def _shaped(search: Search, declared: Fitted, quick: Draft) -> Draft:
    """The fit with the laws' other parameters where fitted runs want them and unused ones agree.

    How sharply a law sticks has no derivative to speak of from far away, so sizes are tried, each
    with all else fitted again.
    """
    best, counted = quick, quick.counted
    free = [p for p in quick.whole.parameters if p.name in quick.held and p.name not in counted]
    for p in free:
        for factor in (APART, 1.0 / APART):
            while p.minimum > 0.0:
                value = float(np.clip(best.held[p.name] * factor, p.minimum, p.maximum))
                found = _again(search, best, {**best.held, p.name: value})
                if found is None or search.gain(best.fitted, found.fitted) <= GATE:
                    break
                best = found
    if not search.freer(quick.fitted, best.fitted):
        return quick
    _note(search, declared, best.fitted)
    names = ", ".join(sorted(best.fitted.labels))
    search.say(f"{names}: {search.gain(quick.fitted, best.fitted):.0f} nats by other shapes")
    return best


def _again(
    search: Search, draft: Draft, held: Mapping[str, float], effort: Effort = ROUGHLY
) -> Draft | None:
    """Another fit of the same set from where one ended; None if it cannot be simulated."""
    problem, fitted = draft.whole.hold(held), draft.fitted
    values = {**draft.held, **fitted.estimate.values}
    theta = np.array([values[name] for name in problem.names])
    try:
        start = theta.clip(problem.lower, problem.upper)
        simulator = corrected(fitted.simulator.of(problem), start, search.raw)
        result = search.judged(fit(simulator, start, effort=effort))
    except CosimError as error:
        search.say(f"with other shapes: {error}")
        return None
    result.effects, result.signature = fitted.effects, fitted.signature
    return Draft(result, draft.whole, dict(held))


def _note(search: Search, declared: Fitted, fitted: Fitted) -> None:
    """Remember a fit, judged by unused runs against the declared model."""
    fitted.gate = compare(search.check_data, declared.check, fitted.check, search.checking)
    search.note(fitted)


def _spanned(problem: Problem, values: dict[str, float]) -> Problem:
    """Strengths with spans of what they are expected to be."""
    return problem.with_parameters(
        [
            replace(p, span=abs(values[p.name])) if p.strength and values.get(p.name) else p
            for p in problem.parameters
        ]
    )


def _start(problem: Problem, declared: Vector, values: dict[str, float]) -> Vector:
    theta = problem.nominal
    theta[: declared.size] = declared
    for name, value in values.items():
        if name in problem.names:
            theta[problem.index(name)] = value
    return np.asarray(theta.clip(problem.lower, problem.upper))
