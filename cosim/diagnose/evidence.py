"""Evidence of sets of candidates: what several of them explain together, before any is fitted.

With the signatures E of the candidates and the residual r, both free of what calibration absorbs,
a set S explains

    1/2 b_S' G_S^-1 b_S,   G = E'E,   b = E'r

to first order. Two effects of which each alone explains nothing, since calibration made the best of
their sum, are found so. Singles and pairs of the best candidates are all looked at, larger sets by
adding to the best ones.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from .signature import Signature

Vector = NDArray[np.float64]
BEST = 40
"""Candidates that are paired: 780 pairs, which take milliseconds."""
DISTINCT = 0.02
"""Share of a signature that others must leave of it: with less, the amplitudes of a set are
differences of large numbers, and a first order is not that exact."""


@dataclass(frozen=True)
class EffectSet:
    """Candidates that explain the residual together.

    Attributes:
        items: their signatures, the one that the set misses most first.
        amplitudes: factors on these.
        evidence: gain to first order less what the choice costs [nats].
        share: of the residual's square that it explains.
    """

    items: tuple[Signature, ...]
    amplitudes: tuple[float, ...]
    evidence: float
    share: float


def sets_of(signatures: Sequence[Signature], residual: Vector, size: int = 2) -> list[EffectSet]:
    """Sets of up to so many candidates, the one with most evidence first.

    A set of which an amplitude has a sign that its strength cannot have is none: a smaller one does
    better.

    Args:
        signatures: of candidates on the same runs.
        residual: of the model without them, what calibration absorbs taken away.
        size: effects in a set at most.
    """
    seen = [s for s in signatures if not s.unseen]
    rows = np.array([s.rest for s in seen], dtype=np.float64).reshape(len(seen), residual.size)
    gram, wanted = rows @ rows.T, rows @ residual
    total = float(residual @ residual)

    def found(places: tuple[int, ...]) -> EffectSet | None:
        part = gram[np.ix_(places, places)]
        scale = np.sqrt(np.diag(part))
        part = part / np.outer(scale, scale)
        if np.linalg.eigvalsh(part)[0] < DISTINCT:
            return None
        inverse = np.linalg.inv(part)
        factors = inverse @ (wanted[list(places)] / scale)
        gain = 0.5 * float(factors @ part @ factors)
        missed = factors**2 / np.diag(inverse)
        amplitudes = factors / scale
        for place, amplitude in zip(places, amplitudes.tolist(), strict=True):
            if amplitude <= 0.0 and seen[place].strength.minimum >= 0.0:
                return None
        order = np.argsort(-missed, kind="stable").tolist()
        free = sum(1 + seen[place].tuned for place in places)
        cost = free + math.log(math.comb(len(signatures), len(places)))
        return EffectSet(
            tuple(seen[places[i]] for i in order), tuple(float(amplitudes[i]) for i in order),
            gain - cost, 2.0 * gain / total if total > 0.0 else 0.0,
        )  # fmt: skip

    def all_of(groups: Iterator[tuple[int, ...]]) -> list[EffectSet]:
        sets = [item for places in groups if (item := found(places)) is not None]
        return sorted(sets, key=lambda item: -item.evidence)

    order = np.argsort([-s.score.gain for s in seen], kind="stable").tolist()[:BEST]
    sets = all_of((i,) for i in range(len(seen)))
    if size > 1:
        sets += all_of(combinations(order, 2))
    return sorted(sets, key=lambda item: -item.evidence)
