"""What candidates do to the model values, and which of them are worth a closer look.

`docs/method.md` calls a signature a trace.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..calibrate.parts import Parameter
from .candidates import Candidate
from .linear import ABSORBED, ScoreTest
from .probes import Probe

Vector = NDArray[np.float64]
EVIDENT, SHARE = 3.0, 0.02
"""A candidate whose first simulation gains less than 3 nats (noise does, in one of a hundred),
or less than 1/50 of what the best one gains, is not simulated again."""
KEPT = 40
"""Candidates that go from one run to all of them at most: each costs a simulation of all runs, and
so many are a fit's worth (two for each of ten parameters, and its steps)."""
DIGITS = 5
"""Of gains by which candidates are put in order: signatures of two laws that are one agree to 1e-6
(`merge`), and what is behind that depends on the processor."""
HIDDEN = 0.98
"""Share of a signature's energy beyond which one run cannot tell it from other parameters."""
WHOLES = 3
"""Groups whose members act alike that are refitted at most."""
STRETCH, COARSE = 64, 0.03
"""Unit vectors with a cosine of 1 - 1e-6 differ by 0.0014, sums over 64 of their entries by at most
8 times that, and rounding."""


@dataclass
class Signature:
    """What a candidate does to the model values.

    Attributes:
        probe: the candidate in the system that was simulated.
        value: strength at which the secant was taken.
        change: model values over sigma with the effect less those without (float32).
        rest: what of it calibration cannot absorb, stretches that are far off counted less.
        score: of `rest` against the residual.
        absorbed: share of the signature's energy that calibration absorbs.
        second: value of the effect's second parameter (see `SearchHints.mix`).
        fixed: its parameters that have another value than its FMU's.
        twins: candidates with the same signature; fits may still tell them apart.
    """

    probe: Probe
    value: float
    change: NDArray[np.float32]
    rest: NDArray[np.float32]
    score: ScoreTest
    absorbed: float
    second: float = 0.0
    fixed: dict[str, float] = field(default_factory=dict)
    twins: tuple[Signature, ...] = ()

    @property
    def same(self) -> tuple[str, ...]:
        """Labels of the twins."""
        return tuple(item.candidate.label for item in self.twins)

    @property
    def candidate(self) -> Candidate:
        """Which."""
        return self.probe.candidate

    @property
    def tuned(self) -> int:
        """How many of its parameters were chosen besides the strength."""
        return len(self.fixed) + bool(self.probe.mix)

    @property
    def placed(self) -> bool:
        """Whether it stands at one of a few places that were tried."""
        others = (p for p in self.probe.others if p.hints.tries or p.hints.visits)
        return any(p.name in self.fixed for p in others)

    def at(self, held: Mapping[str, float]) -> Signature:
        """The candidate with parameters of its own held at other values.

        As usual they are not chosen, unless they had been.
        """
        usual, known = {p.name: p.nominal for p in self.probe.others}, self.fixed
        fixed = {n: v for n, v in {**known, **held}.items()
                 if v != usual.get(n) or known.get(n) == v}  # fmt: skip
        return replace(self, fixed=fixed)

    @property
    def strength(self) -> Parameter:
        """Its strength parameter."""
        return self.probe.strength

    @property
    def asked(self) -> Vector:
        """What calibration cannot absorb, at the strength that the residual asks for."""
        return np.asarray(self.score.amplitude * self.rest, dtype=np.float64)

    @property
    def unseen(self) -> bool:
        """Whether calibration absorbs it, or the runs do not show it at all."""
        return self.absorbed > 1.0 - ABSORBED or self.score.size == 0.0

    @property
    def curved(self) -> bool:
        """Whether calibration absorbs so much that what is left may be curvature."""
        return self.absorbed > HIDDEN or self.score.size == 0.0


def unscored(probe: Probe) -> Signature:
    """A candidate of which only fits are judged; they begin at its value, a typical strength."""
    nothing = np.zeros(0, dtype=np.float32)
    none = ScoreTest(0.0, 0.0, 0.0, 1.0, 0.0, 1.0)
    return Signature(probe, probe.strength.span, nothing, nothing, none, 0.0)


def worthy(found: Sequence[Signature], starts: Container[str] = ()) -> list[Signature]:
    """Of candidates seen in one run, those worth a simulation of all runs, the best first.

    What calibration absorbs in this run alone may still tell something in all of them together.

    Args:
        found: candidates.
        starts: prefixes of those that differ from run to run by values that the runs state; one
            run says nothing of these.
    """
    best = max((s.score.gain for s in found), default=0.0)
    kept = [
        s
        for s in found
        if s.score.gain > max(EVIDENT, SHARE * best) or (s.score.size > 0.0 and s.absorbed > HIDDEN)
    ]
    # of laws that are one in this run, the first of the catalogue stays first on any machine
    kept.sort(key=lambda s: -float(f"{s.score.gain:.{DIGITS}g}"))
    kept = kept[:KEPT]
    known = {s.candidate for s in kept}
    return kept + [
        s for s in found
        if s.candidate.prefix in starts and s.score.size > 0.0 and s.candidate not in known
    ]  # fmt: skip


def merge(signatures: list[Signature]) -> list[Signature]:
    """Leave one of those whose signatures are the same up to a factor, the first one.

    Args:
        signatures: simpler ones first, lest one turn of a ripple stand for an unbalance.
    """
    kept: list[tuple[Signature, NDArray[np.float32], float]] = []
    for item in signatures:
        # sums over stretches are quick to compare, and differ where signatures do
        coarse = np.add.reduceat(item.change, np.arange(0, item.change.size, STRETCH))
        size = float(np.linalg.norm(item.change))
        if size > 0.0:
            coarse /= np.float32(size)
        for other, rough, norm in kept:
            if size * norm == 0.0 or (
                float(np.linalg.norm(coarse - rough)) > COARSE
                and float(np.linalg.norm(coarse + rough)) > COARSE
            ):
                continue
            # 1e-6: cosine between float32 signatures of the same simulation
            if abs(float(item.change @ other.change)) / (size * norm) > 1.0 - 1e-6:
                other.twins = (*other.twins, item)
                break
        else:
            kept.append((item, coarse, size))
    return [item for item, _, _ in kept]


def kind(candidate: Candidate) -> tuple[str, str, str]:
    """What members of a group (swivels of casters) and the whole of it have in common."""
    return candidate.effect, candidate.instance, candidate.port.rpartition(".")[2]


def groups_of(
    chosen: Sequence[Signature],
    able: Sequence[Signature],
    single: Container[tuple[str, str]],
    least: float,
) -> list[Signature]:
    """Of what acts alike on a whole group, those of which members are refitted.

    What one caster explains by far too much friction, all of them may explain by a little: where
    casters turn over, first orders do not tell which gains more.

    Args:
        chosen: candidates that are refitted.
        able: candidates that may be.
        single: instances and ports of balances; others are groups of them.
        least: gain below which a group is no rival.
    """
    members = {
        kind(s.candidate) for s in chosen if (s.candidate.instance, s.candidate.port) in single
    }
    known = {s.candidate.label for s in chosen}
    groups = [
        s
        for s in able
        if s.candidate.label not in known
        and (s.candidate.instance, s.candidate.port) not in single
        and kind(s.candidate) in members
        and s.score.gain > least
    ]
    return groups[:WHOLES]
