"""The result of a diagnosis: the verdict and all that tables and pages show of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..calibrate.checks.finding import Finding
from ..calibrate.clocks import offsets
from ..calibrate.nuisance import late_values
from ..calibrate.problem import Problem
from .adding import made_of
from .answer import Verdict
from .by_run import ByRun
from .facts import Table
from .foreign import Adapter
from .foreign_words import said
from .further import Further
from .grey_box import Begun, LawFromData
from .localise import Place
from .models import Fitted
from .search import Search
from .small import Small
from .whiteness import WhitenessTest

Vector = NDArray[np.float64]
PURPOSES = ("identification", "validation")


@dataclass
class Diagnosis:
    """Verdict and evidence.

    Attributes:
        problem: the declared system with the data as measured.
        answer: the verdict, and the facts that its sentence says.
        table: of models, which the verdict is a function of.
        search: all rounds.
        before, after: calibrated models without effects, and with those that are named.
        located: where an unknown input would have to enter the declared system, the best first.
        everywhere: whether all places were asked.
        single: the law at one place that was asked before sets of named laws.
        residuals: (`before`/`after`, run) -> residuals over sigma, free of the step's error.
        structure: (`before`/`after`, purpose) -> tests.
        power: see `power.power`.
        small: laws that show beside the model of the answer, too small to be named.
        by_run: declared parameters that may differ between runs, of a machine that is unexplained.
        withheld: effects that were left out of the catalogue.
        experiment: proposed to separate rivals.
        ended: run -> time from which it does not count: what happens there hangs on small changes
            of start values (see `unstable`).
        further: the models on runs that need another system.
        asked: whether a law was asked for, and no catalogue.
        law: made from the data where something enters that has no name.
        bursts: times of sudden residuals of a model that is at the noise elsewhere, by run.
        files: written ones.
        findings: on the data.
        adapters: at the connections of FMUs without sources.
    """

    problem: Problem
    answer: Verdict
    table: Table = field(default_factory=Table)
    search: Search | None = None
    before: Fitted | None = None
    after: Fitted | None = None
    located: list[Place] = field(default_factory=list)
    everywhere: bool = False
    single: Begun | None = None
    residuals: dict[tuple[str, str], Vector] = field(default_factory=dict)
    structure: dict[tuple[str, str], list[WhitenessTest]] = field(default_factory=dict)
    power: dict[str, dict[str, Any]] = field(default_factory=dict)
    small: list[Small] = field(default_factory=list)
    by_run: list[ByRun] = field(default_factory=list)
    experiment: dict[str, Any] | None = None
    ended: dict[str, float] = field(default_factory=dict)
    further: list[Further] = field(default_factory=list)
    asked: bool = False
    law: LawFromData | None = None
    bursts: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    files: list[Path] = field(default_factory=list)
    withheld: tuple[str, ...] = ()
    wall: float = 0.0
    warnings: list[str] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    adapters: tuple[Adapter, ...] = ()

    def _repr_html_(self) -> str:
        from .notebook import shown

        return shown(self.to_dict(), self.problem, self.residuals)

    @property
    def verdict(self) -> str:
        """One of effect_found, nothing_missing, confounded, unexplained, bad_data."""
        return self.answer.kind

    @property
    def reason(self) -> str:
        """The verdict in sentences."""
        parts = ["" if self.asked else self.answer.reason, *self._by_run(), self.inside]
        parts += [self.law.reason] if self.law is not None else []
        return " ".join(part for part in parts if part) or self.answer.reason

    def _by_run(self) -> Iterator[str]:
        """What is said of parameters that may differ between runs."""
        yield from (item.sentence for item in self.by_run[:1])
        if others := [item.parameter for item in self.by_run[1:]]:
            yield f"The data do not tell it from {' and '.join(others)}."

    @property
    def inside(self) -> str:
        """Whether what is missing lies inside an FMU without sources, "" if there is none."""
        return "" if self.asked else said(self.answer, self.located, self.adapters)

    def rms(self, which: str, purpose: str) -> dict[str, float | None]:
        """Channel -> RMS residual in its unit over the runs of a purpose."""
        rows = [
            self.residuals[which, run.name]
            for run in self.problem.runs
            if run.purpose == purpose and (which, run.name) in self.residuals
        ]
        if not rows:
            return {c.name: None for c in self.problem.channels}
        stacked = np.concatenate(rows)
        found: dict[str, float | None] = {}
        for column, channel in enumerate(self.problem.channels):
            values = stacked[:, column]
            values = values[np.isfinite(values)]
            found[channel.name] = (
                float(np.sqrt(np.mean(values**2))) * channel.sigma if values.size else None
            )
        return found

    def to_dict(self) -> dict[str, Any]:
        """As of `cosim diagnose --json`."""
        table: dict[str, Any] = {
            "dataset": self.problem.name,
            "system": self.problem.file.path.stem,
            **self.answer.to_dict(),
            "reason": self.reason,
            "warnings": self.warnings,
            "findings": [finding.to_dict() for finding in self.findings],
            "model": made_of(self.problem, self.after),
            "inside": self.inside,
            "adapters": {a.name: {**asdict(a), "where": a.where} for a in self.adapters},
            "withheld": list(self.withheld),
            "catalogue_asked": not self.asked,
            "localisation": [place.to_dict() for place in self.located],
            "law_from_data": None if self.law is None else self.law.to_dict(),
            "power": self.power,
            "small_laws": [law.to_dict() for law in self.small],
            "by_run": [item.to_dict() for item in self.by_run],
            "proposed_experiment": self.experiment,
            "channels": {},
            "further_runs": [item.to_dict() for item in self.further],
            "parameters": self.parameters(),
            "clocks": offsets(fitted.estimate) if (fitted := self.after or self.before) else {},
            "start_values": self.start_values(),
            "bursts": self.bursts,
            "unstable_from": self.ended,
            "structure": {
                f"{which} {purpose}": [s.to_dict() for s in tests]
                for (which, purpose), tests in self.structure.items()
            },
            "evaluations": self.search.evaluations if self.search else 0,
            "wall_s": self.wall,
            "files": [str(path) for path in self.files],
        }
        for channel in self.problem.channels:
            table["channels"][channel.name] = {
                "unit": channel.unit,
                "noise_rms": channel.sigma,
                **{
                    which: {p: self.rms(which, p)[channel.name] for p in PURPOSES}
                    for which in ("before", "after")
                },
            }
        return table

    def parameters(self) -> dict[str, Any]:
        """Calibrated parameters before and after."""
        table: dict[str, Any] = {}
        for which, fitted in (("before", self.before), ("after", self.after)):
            if fitted is None:
                continue
            estimate = fitted.estimate
            for i, p in enumerate(estimate.problem.parameters):
                if p.role == "nuisance":
                    continue
                table.setdefault(p.name, {"unit": p.unit})[which] = {
                    "value": float(estimate.theta[i]),
                    "ci95": [float(estimate.low[i]), float(estimate.high[i])],
                    "identifiable": bool(estimate.identifiable[i]),
                    "at_bound": p.name in estimate.at_bound,
                }
        return table

    def start_values(self) -> dict[str, dict[str, float]]:
        """Late values that were estimated, by run."""
        return late_values(self.after.problem) if self.after is not None else {}
