"""Sets of effects compared by fits, where one effect after the other has led to no name.

Far from the data, first orders do not say which effects a model lacks: a trial that stops a shaft
says nothing of the friction that would slow it, and what explains most alone may have no part in
the pair that explains all. Fits do. So where a free force at a port explains what is missing, every
law of that port is fitted beside each of the best sets so far; pairs that explain most to first
order begin as pairs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..errors import CosimError
from .candidates import Candidate
from .composed import composed, freed
from .evidence import sets_of
from .late import LateFitter
from .localise import Place
from .models import GATE, Fitted, compare
from .rounds import Round
from .signature import Signature, unscored
from .together import together
from .verdict import HALF

SIZE = 4
"""Effects in a set at most."""
WIDTH = 2
"""Sets of each size that are built upon: the best by its fit may be wrong where more is missing."""
BEST = 6
"""Candidates of other ports that take part, those that gain most to first order."""
PAIRS = 3
"""Pairs that begin as pairs: first orders leave open which of a few laws alike is in it."""
START = 0.1
"""Share of a typical strength to begin with where the residual asks for none."""


def regrouped(search: LateFitter, stage: Round, places: Sequence[Place]) -> Fitted | None:
    """The best set that fits lead to; None if no force at a port explains what is missing.

    Where runs may turn unstable, quick fits end anywhere, and nothing is compared by them.

    Args:
        search: fits and judges.
        stage: the first round.
        places: where a free force explains what the declared model leaves, the best first.
    """
    if search.raw.unstable or not places or _share(places[0]) < HALF:
        return None
    base = stage.base
    pool = _pool(stage, places[0])
    search.say(f"{len(pool)} laws at {places[0].label} and elsewhere, in sets of up to {SIZE}")
    best, beam, met = base, [base], set[frozenset[str]]()
    for size in range(1, SIZE + 1):
        beam = _grown(search, stage, beam, pool, met)
        better = beam[:1]
        if size > 1 and beam and search.lacking(beam[0]):
            less = [f for e in beam[0].effects if (f := _without(search, beam[0], e, base))]
            beam += _grown(search, stage, less, pool, met)
            beam.sort(key=lambda f: -search.total(base, f))
        if not beam or search.gains(best, beam[0])[0] < GATE:
            break
        best, beam = beam[0], beam[:WIDTH]
        names = " + ".join(c.label for c in best.effects)
        swapped = ", swapped" if better != beam[:1] else ""
        search.say(f"sets of {size}: {names} is the best{swapped}")
        if not search.lacking(best):
            break
    return search.sharpened(best, base) if best.effects else None


def _grown(
    search: LateFitter,
    stage: Round,
    starts: Sequence[Fitted],
    pool: Sequence[Signature],
    met: set[frozenset[str]],
) -> list[Fitted]:
    """The best sets of one effect more than those given, thoroughly fitted.

    Args:
        search: fits and judges.
        stage: the first round.
        starts: models.
        pool: effects.
        met: sets that were fitted; gets the new ones.
    """
    base, trials = stage.base, []
    for items, amplitudes, start in _next(search, stage, starts, pool):
        labels = start.labels | {item.candidate.label for item in items}
        if len(labels) == len(start.labels) or labels in met:
            continue
        met.add(labels)
        found = together(search, start, items, amplitudes, again=False)
        if found is not None:
            found.gate = compare(search.check_data, base.check, found.check, search.checking)
            trials.append(found)
    trials.sort(key=lambda f: -search.total(base, f))
    found = [freed(search, search.sharpened(f, base, draft=True), base) for f in trials[:WIDTH]]
    return sorted(found, key=lambda f: -search.total(base, f))


def _without(search: LateFitter, fitted: Fitted, effect: Candidate, base: Fitted) -> Fitted | None:
    """A model quickly fitted without one of its effects; None if it cannot be simulated."""
    rest = tuple(e for e in fitted.effects if e != effect)
    try:
        problem = composed(search.raw, fitted, rest)
        theta = np.array([fitted.estimate.values[name] for name in problem.names])
        found = search.fitted(search.simulator.of(problem), theta, fitted.estimate)
    except CosimError as error:
        search.say(f"without {effect.label}: {error}")
        return None
    return search.again(found, replace(fitted, effects=rest), base)


def _share(place: Place) -> float:
    """Of what is missing that a free force there explains."""
    return max(curve.explained for curve in place.curves)


def _pool(stage: Round, place: Place) -> list[Signature]:
    """All laws at a port, scored or not, and the best ones elsewhere."""
    scored = {s.candidate: s for s in stage.signatures}
    same = {t.candidate for s in stage.signatures for t in s.twins}
    mine = [
        scored.get(candidate) or unscored(probe)
        for candidate, probe in stage.probes.items()
        if (candidate.instance, candidate.port) == (place.instance, place.port)
        and candidate not in same
    ]
    names = {item.candidate for item in mine}
    return mine + [s for s in stage.signatures if s.candidate not in names][:BEST]


def _next(
    search: LateFitter, stage: Round, starts: Sequence[Fitted], pool: Sequence[Signature]
) -> Iterator[tuple[tuple[Signature, ...], tuple[float, ...], Fitted]]:
    """Effects to be added to the models of a size, with amplitudes: each of a pool, and pairs."""
    unknown = np.zeros(search.fitting.size, dtype=np.float32)
    for start in starts:
        for item in pool:
            # what it changes is known of the first model only
            known = start is stage.base and item.change.size
            one = item if known else replace(item, change=unknown)
            yield (one,), (item.score.amplitude or START,), start
    if not starts or len(starts[0].effects) != 1:
        return
    for pair in [p for p in sets_of(stage.signatures, stage.residual) if len(p.items) > 1][:PAIRS]:
        yield pair.items, pair.amplitudes, stage.base
