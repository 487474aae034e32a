"""What a report is made of, apart from how it looks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..drawing.drawable import Drawable

if TYPE_CHECKING:
    from ..calibrate.problem import Problem
    from ..diagnose import Diagnosis

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class ShownChannel:
    """A measured quantity.

    Attributes:
        name, unit: of the column.
        sigma: its noise.
        signal: what it is in the model.
    """

    name: str
    unit: str
    sigma: float
    signal: str


@dataclass(frozen=True)
class ShownRun:
    """A run.

    Attributes:
        name, purpose: of the run.
        times: [s].
        data: measured, one column per channel.
        residuals: `before` and `after` -> measured less modelled, over the noise; empty where
            nothing was simulated, one entry where both models are the same.
    """

    name: str
    purpose: str
    times: Vector
    data: Vector
    residuals: Mapping[str, Vector] = field(default_factory=dict)

    def excess(self, column: int, which: str = "before") -> float:
        """Mean square of a channel's residual over its noise's; 0 where there is none."""
        values = self.residuals[which][:, column] if which in self.residuals else np.zeros(0)
        values = values[np.isfinite(values)]
        return float(np.mean(values**2)) if values.size else 0.0


@dataclass(frozen=True)
class Material:
    """All that a report of a diagnosis shows.

    Attributes:
        table: as of `cosim diagnose --json`.
        channels, runs: what was measured and modelled.
        system: to be drawn, None if it cannot be built.
        symbols: parameter -> what it is.
        candidates: rounds of the search as tables.
    """

    table: Mapping[str, Any]
    channels: tuple[ShownChannel, ...]
    runs: tuple[ShownRun, ...]
    system: Drawable | None
    symbols: Mapping[str, str]
    candidates: tuple[CandidateRound, ...] = ()


@dataclass(frozen=True)
class CandidateRound:
    """A round of the search.

    Attributes:
        count: distinct candidates.
        aside: those that one run has ruled out.
        rows: effect, score, z, p value, share that calibration absorbs, gain after refitting, gain
            on unused runs with its z, others with the same signature.
        added: the effect that was added, "" if none.
    """

    count: int
    aside: int
    rows: tuple[tuple[str, float, float, float, float, float | None, float | None, float | None,
                      str], ...]  # fmt: skip
    added: str


def symbols(problem: Problem) -> dict[str, str]:
    """What parameters mean, by name."""
    return {p.name: p.text for p in problem.parameters if p.text and not p.run}


def shown_channels(problem: Problem) -> tuple[ShownChannel, ...]:
    """The channels of a problem."""
    return tuple(ShownChannel(c.name, c.unit, c.sigma, c.signal) for c in problem.channels)


def collected(result: Diagnosis) -> Material:
    """The material of a diagnosis."""
    problem = result.problem
    runs = []
    for run in problem.runs:
        kinds = ("before",) if result.after is result.before else ("before", "after")
        found = {k: result.residuals[k, run.name] for k in kinds if (k, run.name) in
                 result.residuals}  # fmt: skip
        runs.append(ShownRun(run.name, run.purpose, run.logged, run.data, found))
    known = symbols(problem) | (symbols(result.after.problem) if result.after is not None else {})
    return Material(
        result.to_dict(), shown_channels(problem), tuple(runs), problem.plain(), known,
        _rounds(result),
    )  # fmt: skip


SHOWN = 12
"""Candidates of a round that are listed."""


def _rounds(result: Diagnosis) -> tuple[CandidateRound, ...]:
    search = result.search
    found = []
    for stage in search.rounds if search is not None else ():
        assert search is not None
        fitted = {f.effects[-1].label: f for f in stage.fitted}
        rows = []
        for item in stage.signatures[:SHOWN]:
            label = item.candidate.label
            refit = fitted.get(label)
            gate = refit.gate if refit else None
            rows.append(
                (
                    label, item.score.gain, item.score.z, stage.corrected[label], item.absorbed,
                    search.gain(stage.base, refit) if refit else None,
                    gate.gain if gate else None, gate.z if gate else None, ", ".join(item.same),
                )
            )  # fmt: skip
        added = stage.winner.effects[-1].label if stage.winner is not None else ""
        found.append(CandidateRound(len(stage.signatures), len(stage.aside), tuple(rows), added))
    return tuple(found)
