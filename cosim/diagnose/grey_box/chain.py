"""From a place to a law: which signals carry it, how, and whether unused runs want it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ...errors import CosimError
from ..localise import Place
from ..models import GATE, GATE_Z, LEVEL, Fitted
from ..search import Search
from .bench import Site
from .nearest import nearest
from .result import LawFromData
from .single import Begun, best_law, improved, left, site_of
from .terms import formula
from .trial import Law, Maker


def unnamed(
    search: Search,
    base: Fitted,
    located: Sequence[Place],
    asked: Site | None = None,
    begun: Begun | None = None,
) -> LawFromData | None:
    """A law from the data at the place that was asked for, else where something enters clearly.

    Args:
        search: the data.
        base: fitted model that lacks it.
        located: places where an unknown input would explain the residual, the best first.
        asked: the place; errors are raised then, else they are the law's reason.
        begun: what was found out there before.
    """
    if asked is not None:
        found = law_from_data(search, base, asked)
        found.reason = f"The catalogue was not asked. {found.reason}"
        return found
    if not located or located[0].evidence < GATE:
        return None
    first = located[0]
    search.say(f"a law from the data at {first.label}")
    place = site_of(first)
    try:
        found = law_from_data(search, base, place, begun)
    except CosimError as error:  # an extra: the verdict stands without it
        return LawFromData(place, False, f"No law at {place.label}: {error}.", search, base)
    alike: tuple[str, ...] = ()
    if begun is not None and begun.site == place:
        alike = tuple(site.label for site in begun.alike)
    if not alike and len(located) > 1 and abs(first.evidence - located[1].evidence) < GATE:
        alike = (located[1].label,)
    if alike:
        found.reason += f" It may as well act at {' or '.join(alike)}."
    return found


def law_from_data(
    search: Search, base: Fitted, site: Site, begun: Begun | None = None
) -> LawFromData:
    """The law that the data want at a place, with all that is said about it.

    Args:
        search: the data.
        base: fitted model that lacks it.
        site: where.
        begun: what was found out before, if that was there and with the same model.

    Raises:
        UnknownNameError: the place has no such element.
        VariantError: no law can enter there.
        CosimError: the system with a law there cannot be simulated.
    """
    say = search.say
    here = begun is not None and begun.site == site and begun.maker.bench.base is base
    if begun is None or begun.law is None or not here:
        begun = best_law(search, base, [(site, 1.0)])
        assert begun is not None
    maker, trials, law = begun.maker, begun.trials, begun.law
    result = LawFromData(site, False, "", search, base, maker)
    if not trials:
        result.reason = (
            f"No signal that a law at {site.label} could follow is recorded and moves, so it would "
            "be a constant."
        )
        return result
    result.needed = math.log(len(trials) / LEVEL)
    if law is None:
        reason = (
            f"o law of a signal of {site.label} tells more about runs that it was not made from."
        )
        noise = not search.lacking(base)
        result.reason = ("The model reaches the noise, and n" if noise else "N") + reason
        return result
    law, few = improved(maker, shorter(maker, law), say), None
    if law.trial.words:
        few = maker.around(law)
    if law.shape.form in ("x", "y"):
        around = maker.tried(law.shape, law)
        few = few or formula(maker, law, around)
        result.law = result.smooth = maker.fitted(around, law, final=True)
        say(f"{result.law.formula}: {left(search, result.law)}")
    if few is not None:
        short = maker.fitted(few, law, final=True)
        say(f"{short.formula}: {left(search, short)}")
        result.smooth = result.smooth or short
        if search.gain(result.smooth.fitted, short.fitted) > -GATE:
            result.law = short
    assert result.law is not None and result.smooth is not None
    _judged(result, result.law)
    if result.made:
        result.named = nearest(maker, result.smooth)
    return result


def shorter(maker: Maker, law: Law) -> Law:
    """A formula without the terms that gain nothing once the others are fitted."""
    while len(law.trial.words) > 1:
        without = [
            maker.fitted(maker.around(law, [w for w in law.trial.words if w != word]), law)
            for word in law.trial.words
        ]
        best = min(without, key=lambda one: one.fitted.estimate.robust)
        if best.fitted.estimate.robust > law.fitted.estimate.robust + GATE:
            break
        law = best
    return law


def _judged(result: LawFromData, law: Law) -> None:
    """Whether unused runs want it."""
    search, gate = result.search, law.fitted.gate
    assert gate is not None
    unused = any(run.purpose != "identification" for run in search.checking.runs)
    wanted = gate.gain > result.needed and gate.z > GATE_Z
    material = search.material(result.base, law.fitted)
    result.made = wanted and material
    where = f"{law.kind} at {result.site.label}"
    if not result.made:
        result.reason = (
            f"Runs that were not used for fitting do not want {where}: they gain {gate.gain:.1f} "
            f"nats of {result.needed:.1f} that they should (z {gate.z:.1f})."
            if not wanted else f"What {where} changes is too small to be told from errors of the "
            "sheet's noise."
        )  # fmt: skip
        return
    result.reason = f"{where[0].upper()}{where[1:]} holds on runs that were not used for fitting."
    if not unused:
        result.reason = f"{where[0].upper()}{where[1:]} explains the runs; none was kept unused."
    if search.lacking(law.fitted):
        result.reason += " The residual with it still holds more than noise."
