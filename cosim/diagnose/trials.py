"""The strengths at which one candidate was simulated so far, and what that told."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from .probes import Probe
from .signature import SHARE, Signature


@dataclass
class Trials:
    """Simulations of one candidate so far.

    Attributes:
        probe: the candidate in its system.
        value: strength to try next.
        tried: strengths that were tried.
        best: signature at the strength nearest to the one that the residual asks for.
        second: value of its second parameter at which it is tried.
        fixed: its parameters that have another value than its FMU's.
        asked: strength that was tried -> share of it that the residual asked for.
        promise, wish: gain [nats] and amplitude of the last one, whatever its sign.
        going: whether another may be tried.
        rough: whether `best` was measured together with other elements of a vector.
        known: whether its second parameter is known well enough to begin with.
        weak: strength that was seen not to show, where a greater one does.
        error: of the last one that could not be simulated.
    """

    probe: Probe
    value: float
    tried: list[float] = field(default_factory=list)
    best: Signature | None = None
    second: float = 0.0
    fixed: Mapping[str, float] = field(default_factory=dict)
    asked: dict[float, float] = field(default_factory=dict)
    promise: float = 0.0
    wish: float = 0.0
    going: bool = True
    rough: bool = False
    known: bool = False
    weak: float = 0.0
    error: str = ""

    def between(self) -> float | None:
        """Where the residual would ask for the whole strength, if trials lie on both sides of it.

        Limits and dead zones do nothing up to a strength and much beyond, so that shares lead from
        one side to the other; their logarithm over that of the strength is straighter.
        """
        weak = max(((v, a) for v, a in self.asked.items() if a > 1.0 and v > 0.0), default=None)
        strong = min(((v, a) for v, a in self.asked.items() if 0.0 < a < 1.0), default=None)
        if weak is None or strong is None or weak[0] >= strong[0]:
            return None
        part = np.log(weak[1]) / np.log(weak[1] / strong[1])
        return float(weak[0] * (strong[0] / weak[0]) ** part)

    def clipped(self, value: float) -> float:
        """A strength inside its bounds."""
        strength = self.probe.strength
        return float(np.clip(value, strength.minimum, strength.maximum))


def by_problem(trials: Sequence[Trials]) -> list[list[Trials]]:
    """Trials in the same system, which share its sessions."""
    groups: dict[int, list[Trials]] = {}
    for one in trials:
        groups.setdefault(id(one.probe.problem), []).append(one)
    return list(groups.values())


def shared(trials: list[Trials]) -> list[Trials]:
    """Trials without the effect on a whole vector, unless every element asks for it.

    Else it would be taken for its gain at the elements that have it, and rounds would be spent on
    taking it off the others.
    """
    gains = [t.best.score.gain for t in trials if t.rough and t.best is not None]
    if min(gains, default=0.0) > SHARE * sum(gains):
        return trials
    return [t for t in trials if t.rough]


def nearer(item: Signature, other: Signature) -> bool:
    """Whether one trial's strength is nearer to the one that the residual asks for.

    Farther than any, if calibration absorbs all that the strength does. If it absorbs nearly all,
    what is left is curvature, unless it is small: then the one that gains more, as beside one that
    asks for none at all.
    """
    if all(one.curved or not one.score.gain for one in (item, other)):
        return item.score.gain > other.score.gain
    return _mismatch(item) < _mismatch(other)


def _mismatch(item: Signature) -> tuple[bool, float]:
    return item.unseen, abs(float(np.log(max(item.score.amplitude, 1e-6))))
