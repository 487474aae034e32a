"""Is it one law at one place? Asked before sets of named laws are compared, and where one is made.

At each place what an effort there leaves tells whether what is missing acts there, and first orders
along that motion which law it is (`along`). The best law of each place is fitted: of a few terms of
one signal, of smooth curves, of terms of two signals, until one leaves nothing but noise, in unused
runs, too. What is missing is that law then, whatever it is called: named laws at other places could
only describe it worse.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from ...errors import CosimError
from ..localise import PLACES, Place
from ..models import GATE, LEVEL, Fitted
from ..search import Search
from ..whiteness import whiteness_tests
from .along import Along
from .bench import LawBench, Site
from .terms import formula
from .trial import Law, Maker, Trial

LESS = 2.0
"""Mean square that an effort at a place may leave over what one elsewhere leaves: at places of one
cause it is the same but for what its knots cannot follow, which is less than all it leaves."""
FITTED = 2
"""Laws of a kind that are fitted at a place, of different signals: an effort has too few knots for
friction that changes its sign, and first orders may take one signal for another."""
SAME = 0.01
"""Share by which a free curve elsewhere may explain less and do as well: at two ends of a shaft
they differ by less."""
ALL = 0.9
"""Share of what is missing that a free curve at a place explains in the worst run, or a law along
the log, where one law there may be all: nine knots follow none better, nor do first orders."""
PASSES, FALL = 8, 0.1
"""Times at most that first orders are taken again where a fit has ended, and the share of what the
model then leaves beyond noise that each must remove to be followed by another one."""


@dataclass(frozen=True)
class Begun:
    """Laws at a place.

    Attributes:
        maker: of laws there.
        trials: all that were asked there, the best first.
        law: the best one fitted, None if runs want none.
        enough: whether that leaves noise in all runs.
        alike: places at which a law does so, too.
    """

    maker: Maker
    trials: list[Trial] = field(default_factory=list)
    law: Law | None = None
    enough: bool = False
    alike: tuple[Site, ...] = ()

    @property
    def site(self) -> Site:
        """The place."""
        return self.maker.bench.site

    @property
    def label(self) -> str:
        """Of the place."""
        return self.site.label


def site_of(place: Place) -> Site:
    """A place as that of a law."""
    return Site(place.instance, place.port, place.element, place.unit)


def single(search: Search, base: Fitted, located: Sequence[Place]) -> Begun | None:
    """The best law at one of the places where free curves explain most; None if none can be asked.

    Args:
        search: the data.
        base: the declared model.
        located: the places, the best first.
    """
    some = located[:PLACES]
    return best_law(search, base, [(site_of(p), p.curves[0].explained) for p in some])


def best_law(search: Search, base: Fitted, sites: Sequence[tuple[Site, float]]) -> Begun | None:
    """The best law at one of some places; None if none can be asked.

    Args:
        search: the data.
        base: the model that lacks it.
        sites: the places, and the share that a free curve explains there; where one leaves noise,
            others that explain less are not asked. Of several, only laws are fitted that may be all
            that is missing.

    Raises:
        CosimError: it is one place, and no law can enter there.
    """
    asked: list[Along] = []
    begun: list[Begun] = []
    shares: list[float] = []

    def needless(explained: float) -> bool:
        found = any(b.enough for b in begun)
        return found and explained < (1.0 - SAME) * sites[0][1]

    def worth(along: Along) -> Callable[[Trial], bool]:
        return lambda trial: len(sites) == 1 or along.share(trial) > ALL

    for site, explained in sites:
        if needless(explained):
            continue
        try:
            along = Along(Maker(LawBench(search, base, site)))
            one = _with(search, Begun(along.maker), along.terms(), worth(along))
        except CosimError as error:
            if len(sites) == 1:
                raise
            search.say(f"no law at {site.label}: {error}")
            continue
        asked.append(along)
        shares.append(explained)
        begun.append(one)
        begun[-1] = _settled(search, begun, len(begun) - 1)
    least = min((a.left for a in asked if a.left is not None), default=math.inf)
    kept = [k for k, a in enumerate(asked) if a.left is None or a.left <= LESS * least]
    kinds: list[Callable[[Along], list[Trial]]] = [Along.curves, Along.pairs]
    for kind in kinds:
        if any(b.enough for b in begun):
            break
        for number in kept:
            if needless(shares[number]):
                continue
            try:
                along = asked[number]
                begun[number] = _with(search, begun[number], kind(along), worth(along))
            except CosimError as error:
                search.say(f"{begun[number].label}: {error}")
            begun[number] = _settled(search, begun, number)
    known = sorted([b for b in begun if b.enough] or begun, key=_cost)
    if not known:
        return None
    return replace(known[0], alike=tuple(b.site for b in known[1:] if b.enough))


def _with(
    search: Search, before: Begun, trials: list[Trial], worth: Callable[[Trial], bool]
) -> Begun:
    """Further laws at a place, the best of them fitted if runs that were left out want them.

    Args:
        search: the data.
        before: laws there that were asked before.
        trials: further ones.
        worth: whether one promises enough to be fitted.
    """
    known = sorted([*before.trials, *trials], key=lambda t: -t.expected)
    best, maker = replace(before, trials=known), before.maker
    firsts: dict[str, Trial] = {}
    for trial in trials:
        if trial.expected > math.log(len(known) / LEVEL) and worth(trial):
            firsts.setdefault(trial.shape.label, trial)
    for trial in list(firsts.values())[:FITTED]:
        law = maker.sharper(maker.fitted(trial))
        search.say(f"{before.label}: {law.formula}, {left(search, law)}")
        other = replace(best, law=law)
        if _cost(other) < _cost(best):
            best = other
        if not search.lacking(law.fitted):
            break
    return best


def _settled(search: Search, begun: Sequence[Begun], number: int) -> Begun:
    """A place, and whether its law leaves noise; fitted to the end if it may, or is the best."""
    one = begun[number]
    law, maker = one.law, one.maker
    if law is None:
        return one
    first = one is min(begun, key=_cost)
    try:
        if (first or not search.lacking(law.fitted)) and not leaves_noise(search, law):
            law = maker.exact(law)
        if first and not leaves_noise(search, law):
            law = improved(maker, law, search.say)
        return replace(one, law=law, enough=_enough(search, maker, law))
    except CosimError as error:
        search.say(f"{one.label}: {error}")
        return one


def _enough(search: Search, maker: Maker, law: Law) -> bool:
    """Whether a law leaves noise, or where unused runs go farther, its formula does."""
    if leaves_noise(search, law):
        return True
    if search.lacking(law.fitted) or law.trial.words:
        return False
    short = formula(maker, law, maker.around(law))
    return short is not None and leaves_noise(search, maker.exact(maker.fitted(short, law)))


def improved(maker: Maker, law: Law, say: Callable[[str], None]) -> Law:
    """A law fitted again from where first orders lead around it, until little is gained."""
    for _ in range(PASSES):
        before = law.fitted.estimate.robust
        new = maker.sharper(maker.fitted(maker.around(law), law))
        if new.fitted.estimate.robust < before:
            law = new
        noise = 0.5 * law.fitted.estimate.count
        if before - law.fitted.estimate.robust < max(FALL * (before - noise), GATE):
            break
        say(f"once more from there: {left(maker.search, law)}")
    return law


def leaves_noise(search: Search, law: Law) -> bool:
    """Whether it leaves nothing but noise, also in runs that were not used."""
    unused = whiteness_tests(search.check_data - law.fitted.check, search.checking)
    return not search.lacking(law.fitted) and not any(s.structured for s in unused)


def left(search: Search, law: Law) -> str:
    """What a law leaves, as said."""
    fitted = law.fitted
    used, unused = (
        math.sqrt(float((data - model) @ (data - model)) / max(data.size, 1))
        for data, model in ((search.fit_data, fitted.fit), (search.check_data, fitted.check))
    )
    return f"{used:.2f} times the noise left, {unused:.2f} in unused runs"


def _cost(begun: Begun) -> float:
    fitted = begun.maker.bench.base if begun.law is None else begun.law.fitted
    return fitted.estimate.robust + fitted.free
