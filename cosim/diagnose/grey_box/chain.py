"""From a place to a law: which signals carry it, how, and whether unused runs want it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...errors import CosimError
from ..localise import Place
from ..models import GATE, GATE_Z, LEVEL, Fitted, is_open
from ..search import Search
from .basis import ALONG_Y, Shape
from .bench import ANGLES, LawBench, Site
from .nearest import nearest
from .result import LawFromData
from .terms import formula
from .trial import Law, Maker, Trial

DENSE, WIDTHS = 0.1, (math.inf, 0.01)
"""Share of the largest size of a signal around which knots are dense at 0, and other shares that
are tried: friction rises and falls near 0, drag far from it."""
ORDERS = 16
"""Cycles per turn that are tried for laws of an angle at most."""
FITTED = 4
"""Signals of which a law is fitted where first orders do not tell which one carries it."""
PASSES, FALL = 8, 0.1
"""Times at most that first orders are taken again where a fit has ended, and the share of what the
model then leaves beyond noise that each must remove to be followed by another one."""
CROSSED = 0.05
"""Share of a signal's largest size that it must reach on both sides of 0 to have a 0 within."""


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
    alike = begun.alike if begun is not None and begun.maker.bench.site == place else ()
    if not alike and len(located) > 1 and abs(first.evidence - located[1].evidence) < GATE:
        alike = (located[1].label,)
    if alike:
        found.reason += f" It may as well act at {' or '.join(alike)}."
    return found


def site_of(place: Place) -> Site:
    """A place as that of a law."""
    return Site(place.instance, place.port, place.element, place.unit)


@dataclass(frozen=True)
class Begun:
    """Laws of one signal at a place, to first order.

    Attributes:
        maker: of laws there.
        trials: all that were tried there, the best first.
        law: the best one fitted, None if it was not.
        enough: whether that leaves noise in all runs.
        alike: places at which a law of one signal would gain as much.
    """

    maker: Maker
    trials: list[Trial]
    law: Law | None = None
    enough: bool = False
    alike: tuple[str, ...] = ()


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
    if begun is None or begun.maker.bench.site != site or begun.maker.bench.base is not base:
        maker = Maker(LawBench(search, base, site))
        begun = Begun(maker, sorted(singles(maker), key=lambda t: -t.expected))
    maker, trials = begun.maker, begun.trials
    result = LawFromData(site, False, "", search, base, maker)
    if not trials:
        result.reason = f"No signal of {site.label} moves, so a law there would be a constant."
        return result
    for trial in trials[:3]:
        say(f"{site.label}: a law of {trial.shape.label} gains {trial.expected:.0f} nats on "
            "runs left out, to first order")  # fmt: skip
    result.needed = math.log(len(trials) / LEVEL)
    if trials[0].expected < result.needed and not search.lacking(base):
        result.reason = (
            f"The model reaches the noise, and no law of a signal of {site.label} tells more about "
            "runs that it was not made from."
        )
        return result
    if begun.law is not None and begun.enough:
        law = begun.law
    else:
        law = refined(maker, best_of(maker, trials, is_open(base.estimate), say), say)
    others = pairs(maker, law) if search.lacking(law.fitted) else []
    result.needed = math.log((len(trials) + len(others)) / LEVEL)
    others = [item for item in others if item[0] > result.needed]
    if others:
        others.sort(key=lambda item: -item[0])
        gain, first = others[0]
        say(f"a law of {first.shape.label} gains {gain:.0f} nats more, to first order")
        both = best_of(maker, [t for _, t in others], is_open(law.fitted.estimate), say, law)
        if search.gain(law.fitted, both.fitted) > GATE:
            law = both
    (again,) = maker.tried(law.shape, law)
    smooth = maker.fitted(again, law, final=True)
    say(f"law of {smooth.shape.label}: {_left(search, smooth)}")
    result.law = result.smooth = smooth
    if (few := formula(maker, law, again)) is not None:
        short = maker.fitted(few, law, final=True)
        say(f"{short.formula}: {_left(search, short)}")
        if search.gain(smooth.fitted, short.fitted) > -GATE:
            result.law = short
    _judged(result, result.law)
    if result.made:
        result.named = nearest(maker, smooth)
    return result


def _judged(result: LawFromData, law: Law) -> None:
    """Whether unused runs want it."""
    search, gate = result.search, law.fitted.gate
    assert gate is not None
    unused = any(run.purpose != "identification" for run in search.checking.runs)
    wanted = gate.gain > result.needed and gate.z > GATE_Z
    material = search.material(result.base, law.fitted)
    result.made = wanted and material
    where = f"a law of {law.shape.label} at {result.site.label}"
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


def best_of(
    maker: Maker, trials: list[Trial], far: bool, say: Callable[[str], None],
    around: Law | None = None,
) -> Law:  # fmt: skip
    """The best law of some, the best to first order first.

    Where a model is far off, first orders do not tell which: one for each signal is fitted.
    """
    firsts: dict[str, Trial] = {}
    for trial in trials:
        firsts.setdefault(trial.shape.label, trial)
    chosen = list(firsts.values())[: FITTED if far else 1]
    laws = []
    for trial in chosen:
        laws.append(improved(maker, trial, say, around))
        if not maker.search.lacking(laws[-1].fitted):
            break
    return min(laws, key=lambda law: law.fitted.estimate.robust + law.fitted.free)


def improved(
    maker: Maker, trial: Trial, say: Callable[[str], None], around: Law | None = None
) -> Law:
    """A law fitted roughly, from where first orders lead and then from there again."""
    law = maker.fitted(trial, around)
    say(f"law of {law.shape.label} fitted: {_left(maker.search, law)}")
    for _ in range(PASSES):
        before = law.fitted.estimate.robust
        (again,) = maker.tried(law.shape, law)
        new = maker.sharper(maker.fitted(again, law))
        noise = 0.5 * law.fitted.estimate.count
        enough = max(FALL * (before - noise), GATE)
        if new.fitted.estimate.robust < before:
            law = new
        if before - law.fitted.estimate.robust < enough:
            break
        say(f"once more from there: {_left(maker.search, law)}")
    return law


def refined(maker: Maker, law: Law, say: Callable[[str], None]) -> Law:
    """The law on the knots along its first signal by which runs left out are predicted best."""
    x = law.shape.x
    if x is None or math.isinf(dense(maker.bench, x.signal)):
        return law
    (own,) = maker.tried(law.shape, law)
    best, most = law, own.regression.predicted
    for width in WIDTHS:
        axis = replace(maker.bench.axis_x(x.signal, dense=width), jump=x.jump)
        other = maker.redrawn(law, axis)
        (trial,) = maker.tried(other.shape, other)
        if trial.regression.predicted > most + GATE:
            best, most = improved(maker, trial, say, other), trial.regression.predicted
    return best


def pairs(maker: Maker, law: Law) -> list[tuple[float, Trial]]:
    """Laws of a second signal beside that of a law, to first order, with what they gain on it.

    A surface over both must do better than a sum of two curves by the gate.
    """
    bench, found = maker.bench, []
    used = {axis.signal for axis in law.shape.axes}
    for signal in varying(bench):
        if signal in used:
            continue
        if law.shape.x is not None:
            order = best_order(maker, law) if signal in ANGLES else 1
            shape = Shape("x * y", law.shape.x, bench.axis_y(signal, order))
        else:
            shape = Shape("x * y", bench.axis_x(signal, dense=dense(bench, signal)), law.shape.y)
        surface, both, own = maker.tried(shape, law, forms=("x + y", law.shape.form))
        found += [
            (both.expected - own.expected, both),
            (surface.expected - own.expected - GATE, surface),
        ]
    return found


def best_order(maker: Maker, around: Law | None) -> int:
    """Cycles per turn of the angle that explain most of what a model lacks, to first order."""
    bench, best = maker.bench, (-math.inf, 1)
    fitted = bench.base if around is None else around.fitted
    rows = maker.search.fitting.by_run(maker.search.fit_data - fitted.fit)
    worst = max(
        zip(rows, bench.names, strict=True), key=lambda item: float(np.nanmean(item[0] ** 2))
    )
    phases = 2.0 * np.pi * np.arange(ALONG_Y) / ALONG_Y
    waves = np.column_stack([np.cos(phases), np.sin(phases)])
    for order in range(1, ORDERS + 1):
        y = bench.axis_y(ANGLES[0], order)
        shape = Shape("y", y=y) if around is None else Shape("x * y", around.shape.x, y)
        directions = waves
        if around is not None:
            directions = np.linalg.pinv(shape.expansion) @ shape.narrowed("y").expansion @ waves
        (trial,) = maker.tried(shape, around, directions, beyond=True, names=worst[1:])
        best = max(best, (trial.expected, order), key=lambda item: item[0])
    return best[1]


def dense(bench: LawBench, signal: str) -> float:
    """Where a signal's knots are dense: at 0 if it crosses it, else nowhere."""
    low, high = bench.ranges[signal]
    return DENSE if min(-low, high) > CROSSED * max(-low, high) else math.inf


def varying(bench: LawBench) -> list[str]:
    """Signals that move in the identification runs."""
    return [
        signal for signal in bench.signals
        if np.ptp(bench.ranges[signal]) > 1e-9 * max(*map(abs, bench.ranges[signal]), 1e-9)
    ]  # fmt: skip


def singles(maker: Maker) -> list[Trial]:
    """Laws of one signal of the place, to first order."""
    bench, found = maker.bench, []
    for signal in varying(bench):
        width = math.inf if signal in ANGLES else dense(bench, signal)
        shapes = [Shape("x", x=bench.axis_x(signal, dense=width))]
        if signal in ANGLES:  # a spring goes on where a ripple repeats
            far = maker.search.lacking(bench.base)
            orders = sorted({1, best_order(maker, None) if far else 1})
            shapes += [Shape("y", y=bench.axis_y(signal, order)) for order in orders]
        for shape in shapes:
            found += maker.tried(shape)
    return found


def _left(search: Search, law: Law) -> str:
    fitted = law.fitted
    used, unused = (
        float(np.sqrt(np.mean((data - model) ** 2)))
        for data, model in ((search.fit_data, fitted.fit), (search.check_data, fitted.check))
    )
    return f"{used:.2f} times the noise left, {unused:.2f} in unused runs"
