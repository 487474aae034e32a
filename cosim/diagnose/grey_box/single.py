"""Is it one law of one signal at one place? Asked before sets of named laws are compared.

At the places where a free curve explains most, a smooth law of each signal is asked to first order:
what it would gain on each run if made from the others. A curve over time explains as much at all
places of one shaft; a law holds from run to run only at its place and over its signal. The best one
is fitted. If it leaves noise, what is missing acts there and on that signal, whatever it is called:
named laws at other places could only describe it worse.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from ...errors import CosimError
from ..localise import PLACES, TIME, Place
from ..models import GATE, LEVEL, Fitted
from ..search import Search
from ..verdict import HALF
from ..whiteness import whiteness_tests
from .bench import LawBench
from .chain import Begun, improved, refined, singles, site_of
from .terms import formula
from .trial import Law, Maker, Trial

NEAR = 0.9
"""Share of what the best free curve explains from which another one may be that of the law: nine
knots follow a law no better."""
PART = 0.1
"""Share of all there is to gain in runs left out from which first orders tell the law; below, its
place may be one that makes up for what acts elsewhere."""
SAME = 0.01
"""Share by which a law elsewhere may be expected to gain less, or a free curve to explain less, and
do as well: first orders of one model at two ends of a shaft differ by less."""


@dataclass(frozen=True)
class Single:
    """The best law of one signal.

    Attributes:
        place: where.
        begun: laws there.
    """

    place: Place
    begun: Begun


def single(
    search: Search, base: Fitted, current: Fitted, located: Sequence[Place]
) -> Single | None:
    """The law of one signal that runs left out want most; None if no place can be asked.

    Args:
        search: the data.
        base: the declared model.
        current: the best model with named laws.
        located: where free curves enter the declared one.
    """
    asked: list[_LawsAt] = []
    for place in located[:PLACES]:
        try:
            maker = Maker(LawBench(search, base, site_of(place)))
            trials = sorted(singles(maker), key=lambda t: -t.expected)
        except CosimError as error:
            search.say(f"no law at {place.label}: {error}")
            continue
        asked.append(_LawsAt(place, maker, trials))
    chosen = _chosen(asked)
    if chosen is None:
        return Single(asked[0].place, Begun(asked[0].maker, asked[0].trials)) if asked else None
    (place, maker, trials), first, alike = chosen
    search.say(f"a law of {first.shape.label} at {place.label}?")
    try:
        law = improved(maker, first, search.say)
        if search.lacking(law.fitted) and search.gains(current, law.fitted)[0] > GATE:
            law = refined(maker, law, search.say)
        enough = _leaves_noise(search, law)
        if not enough:
            law = maker.exact(law)
            enough = _leaves_noise(search, law)
        if not enough and not search.lacking(law.fitted):  # unused runs may go farther
            short = formula(maker, law, *maker.tried(law.shape, law))
            enough = short is not None and _leaves_noise(
                search, maker.exact(maker.fitted(short, law))
            )
    except CosimError as error:
        search.say(f"{place.label}: {error}")
        return Single(place, Begun(maker, trials, alike=alike))
    return Single(place, Begun(maker, trials, law, enough, alike))


class _LawsAt(NamedTuple):
    """A place, laws there, and all of one signal, the best first."""

    place: Place
    maker: Maker
    trials: list[Trial]


def _chosen(asked: Sequence[_LawsAt]) -> tuple[_LawsAt, Trial, tuple[str, ...]] | None:
    """The law that is fitted, that which runs left out want most; and where one would do as well.

    Where a free curve over a signal explains most of the worst run, of those over whose signals one
    explains nearly as much, by evidence if first orders tell little of other runs.
    """
    laws = [(there, t) for there in asked for t in there.trials if _signal(t) != TIME]
    curves = [
        (c, there) for there in asked for c in there.place.curves
        if c.driver != TIME and c.explained > HALF
    ]  # fmt: skip
    curves.sort(key=lambda item: -item[0].evidence)
    if curves:
        least = NEAR * curves[0][0].explained
        drivers = {(id(there), c.driver) for c, there in curves if c.explained > least}
        laws = [(there, t) for there, t in laws if (id(there), _signal(t)) in drivers]
    needed = math.log(max(sum(len(there.trials) for there in asked), 1) / LEVEL)
    best = max(laws, key=lambda item: item[1].expected, default=None)
    if best is not None and best[1].expected > max(needed, PART * _all(best[1])):
        least = best[1].expected - max(SAME * best[1].expected, GATE)
        return *best, _others(best[0], [there for there, t in laws if t.expected > least])
    for curve, first in curves:
        for there, trial in laws:
            if there is first and _signal(trial) == curve.driver:
                least = (1.0 - SAME) * curve.explained
                near = [other for c, other in curves if c.explained > least]
                return there, trial, _others(there, near)
    return None


def _others(first: _LawsAt, alike: Sequence[_LawsAt]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(at.place.label for at in alike if at is not first))


def _all(trial: Trial) -> float:
    """What a law would gain that leaves nothing, residuals counted as in its first orders."""
    return 0.5 * sum(float(gram.matrix[-1, -1]) for gram in trial.grams)


def _signal(trial: Trial) -> str:
    return trial.shape.axes[0].signal


def _leaves_noise(search: Search, law: Law) -> bool:
    """Whether it leaves nothing but noise, also in runs that were not used."""
    unused = whiteness_tests(search.check_data - law.fitted.check, search.checking)
    return not search.lacking(law.fitted) and not any(s.structured for s in unused)
