"""Laws that the data show and that are too small to be named, and what they do to parameters.

A law that changes no channel by `MATERIAL` of its noise has no name, since noise is not known that
exactly. The parameters make up for it all the same, by more than their intervals if they can
nearly do what it does: a heating of 0.1 of the noise moves a resistance by three of its half
intervals. To first order a law that changes the model values by c moves them by -J^+ c; intervals
hold both, the values without it and with it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..calibrate.estimate import Estimate
from .judge import Judge
from .linear import BAND, MATERIAL
from .models import GATE, LEVEL, Fitted
from .rounds import Round
from .search import Search
from .signature import Signature


@dataclass(frozen=True)
class Small:
    """A law that shows beside a model, too small to be named.

    Attributes:
        effect, place: of the catalogue, and where.
        change: largest RMS over the noise that it adds to a channel of a run.
        p_value: of its score on identification runs, corrected for the number of candidates.
        shifts: parameter whose interval is told -> what the law moves it by, to first order; up to
            the end of the 95 % interval of its strength.
    """

    effect: str
    place: str
    change: float
    p_value: float
    shifts: dict[str, float]

    @property
    def sentence(self) -> str:
        """What is said of it."""
        return (
            f"{self.effect} at {self.place} shows, too, with {self.change:.2g} of the noise in the "
            f"worst channel of a run; less than {MATERIAL:g} is not named, and intervals hold the "
            "parameters with it"
        )

    def to_dict(self) -> dict[str, Any]:
        """As in the JSON."""
        return {
            "effect": self.effect, "place": self.place, "times_noise": self.change,
            "p_value": self.p_value, "shifts": self.shifts,
        }  # fmt: skip


def small_laws(search: Search, fitted: Fitted) -> list[Small]:
    """Laws that identification runs show beside a model, and that are too small to be named.

    The best by its score, and those that the data need not tell from it.

    Args:
        search: its rounds have scored the laws; none has, if no round began with this model.
        fitted: the model.
    """
    if search.raw.late:  # there, every law moves the moments at which casters turn, and seems one
        return []
    stages = [s for s in search.rounds if s.base.labels == fitted.labels and not s.scored_elsewhere]
    if not stages:
        return []
    stage, base = stages[-1], stages[-1].base
    shown = [s for s in stage.signatures if _shows(stage, s) and _size(search, s) <= MATERIAL]
    best = max((s.score.gain for s in shown), default=0.0)
    root = search.fitting.root(search.fit_data - base.fit)
    absorber = search.absorber(base, search.fitting, root)
    found = []
    for item in shown:
        if item.score.gain < best - GATE:
            continue
        change = np.asarray(root * item.score.amplitude * item.change, dtype=np.float64)
        farthest = 1.0 + BAND / abs(item.score.z)
        moved = -farthest * absorber.change(change) * base.problem.scale
        pairs = zip(base.problem.parameters, moved.tolist(), strict=True)
        shifts = {p.name: shift for p, shift in pairs if p.role != "nuisance"}
        candidate = item.candidate
        found.append(
            Small(candidate.effect, candidate.place, _size(search, item),
                  stage.corrected[candidate.label], shifts)
        )  # fmt: skip
    return found


def _shows(stage: Round, item: Signature) -> bool:
    """Whether identification runs show a law, with a strength that it can have."""
    value = item.value * item.score.amplitude
    return (
        item.score.gain > GATE
        and stage.corrected[item.candidate.label] < LEVEL
        and item.strength.minimum <= value <= item.strength.maximum
    )


def _size(judge: Judge, item: Signature) -> float:
    """What a law adds to a channel of a run, over the noise."""
    return judge.fitting.largest(item.asked)


def widen(search: Search, fitted: Fitted, known: list[Estimate]) -> None:
    """Let the intervals of a model hold its parameters with each small law.

    Args:
        search: see `small_laws`.
        fitted: the model.
        known: estimates that do already; gets that of the model.
    """
    estimate = fitted.estimate
    if any(estimate is e for e in known):
        return
    problem = estimate.problem
    low, high = estimate.low, estimate.high
    for law in small_laws(search, fitted):
        shift = np.array([law.shifts.get(name, 0.0) for name in problem.names])
        low, high = np.minimum(low, estimate.low + shift), np.maximum(high, estimate.high + shift)
    fitted.estimate = replace(
        estimate, low=np.maximum(low, problem.lower), high=np.minimum(high, problem.upper)
    )
    known.append(fitted.estimate)
