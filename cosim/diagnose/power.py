"""What the data would have shown: the smallest strength of each effect that cannot be missed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.special import ndtri, stdtrit

from ..errors import CosimError
from .linear import MATERIAL, SampleStack
from .models import LEVEL
from .rounds import Round
from .secant import BRACKETED, CURVED, TANGENT, Bench, floor
from .signature import Signature
from .trials import Trials, by_problem

POWER = 0.9
"""Probability with which an effect of the given strength is found."""
ABOUT = 5.0
"""Factor by which the strength that was simulated may differ from the one that is told: saturation
and curvature begin over decades, and closer trials would cost a simulation each."""


def power(
    current: Round, stack: SampleStack, bench: Bench | None = None
) -> dict[str, dict[str, Any]]:
    """Label -> smallest detectable strength, or why the effect cannot be seen.

    Detected is what the score test tells from nothing and what is `MATERIAL`, in the shape that was
    simulated; the gate on unused runs is not in it.

    Args:
        current: the round, whose signatures stand at the strengths that the residual asks for.
        stack: of the runs that were scored.
        bench: simulates them again at about the strengths that are told; none, if they are.
    """
    level = LEVEL / max(len(current.signatures) + len(current.aside), 1)  # as of its p values
    trials = [Trials(s.probe, s.value, best=s) for s in current.signatures]
    told: dict[str, dict[str, Any]] = {}

    def pursued(group: list[Trials]) -> list[Trials]:
        for one in group:
            assert one.best is not None
            label = one.best.candidate.label
            if bench is not None:
                _pursue(one, bench, level)
            told[label] = _entry(one, level, stack)
            one.best = None  # what it does at this strength is not needed again
        return group

    if bench is None:
        pursued(trials)
    else:
        bench.spread(pursued, by_problem(trials))
    return {s.candidate.label: told[s.candidate.label] for s in current.signatures}


def _entry(trials: Trials, level: float, stack: SampleStack) -> dict[str, Any]:
    """What is told of an effect that was simulated at about the strength that would show."""
    item = trials.best
    assert item is not None
    p = item.strength
    entry: dict[str, Any] = {"unit": p.unit, "parameter": p.name, "absorbed": item.absorbed}
    if item.unseen:
        entry["smallest_detectable"] = None
        entry["reason"] = (
            "the runs do not excite it"
            if item.score.size == 0.0
            else "calibration of the declared parameters absorbs all but a thousandth of it"
        )
    else:
        smallest = _smallest(item, level, stack)
        if smallest <= trials.weak:
            smallest = abs(item.value)  # which shows
        entry["smallest_detectable"] = smallest if math.isfinite(smallest) else None
        if not 1.0 / ABOUT <= smallest / abs(item.value) <= ABOUT:
            entry["extrapolated_from"] = abs(item.value)
    entry["same_as"] = list(item.same)
    return entry


def _pursue(trials: Trials, bench: Bench, level: float) -> None:
    """Simulate an effect at about the smallest strength that would show.

    What a strong law leaves says nothing of a weak one: dry friction that holds a shaft is as good
    as a larger inertia, and of a viscous one that is declared curvature is left; a limit does not
    bind yet.
    """
    for _ in range(BRACKETED):
        item, stack = trials.best, bench.stack
        assert item is not None
        before, wanted = abs(item.value), _smallest(item, level, stack)
        if item.unseen:
            size = stack.largest(item.change.astype(np.float64))
            wanted = before * TANGENT / size if size > CURVED else before
        near = wanted
        if wanted <= trials.weak:
            near, wanted = trials.weak, math.sqrt(trials.weak * before)
        value = trials.clipped(math.copysign(wanted, item.value))
        close = before / ABOUT <= near <= before * ABOUT
        if close or abs(value) <= floor(item.strength) or value == item.value:
            return
        try:
            found = bench.again(item, value)
        except CosimError as error:
            trials.error = str(error)
            return
        absorbed = found.unseen and found.score.size > 0.0
        shows = _smallest(found, level, stack) <= ABOUT * abs(value)
        if absorbed or shows or item.unseen or abs(value) > before:
            trials.best = found
        else:
            trials.weak = abs(value)


def _smallest(item: Signature, level: float, stack: SampleStack) -> float:
    """The strength that would show, if what calibration leaves grows with it as around here."""
    told = (
        math.sqrt(-2.0 * math.log(level))
        if item.probe.mix
        else -float(stdtrit(item.score.degrees, level / 2))
    )  # as of the round's p values
    needed = told - float(ndtri(1 - POWER))
    size = item.score.size / max(item.score.spread, 1.0)
    smallest = abs(item.value) * needed / size if size > 0 else math.inf
    share = stack.largest(item.rest.astype(np.float64))
    return max(smallest, abs(item.value) * MATERIAL / share) if share > 0.0 else smallest
