"""What the spread of each sampled parameter does to the results of a study.

    Sobol    S_i  = V[E(y | x_i)] / V[y]           share of the variance that x_i makes alone
             ST_i = E[V(y | x_~i)] / V[y]          with all that it makes together with others
    Morris   EE_i = (y(x + delta e_i) - y(x)) / delta    for x over the unit cube of probabilities
             mu_star = mean |EE_i|, sigma = its standard deviation (bent, or with others)
    else     rank correlation of x_i and y, and what independent samples exceed once in 20

Of the first two SALib makes the indices, and their designs (`global_designs`).

Source: Saltelli et al., Comput. Phys. Commun. 181 (2010) 259; Morris, Technometrics 33 (1991) 161;
correlation as index: digital twin paper, there without a limit.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from ..files import atomic
from .definition import Study
from .global_designs import DESIGNS, LEVELS, block, problem, salib
from .table import ERRORS, StudyTable

Vector = NDArray[np.float64]
LEVEL = 0.05
"""Probability with which samples without any dependence exceed the limit for any parameter."""
RESAMPLES = 1000
"""Of the bootstrap of the intervals: their ends repeat to about a twentieth of their width."""
FEWEST = 10
"""Runs, or blocks of runs, of which indices are made: below, nothing is significant."""


def significance_limit(samples: int, parameters: int, level: float = LEVEL) -> float:
    """Correlation that independent samples exceed with this probability for any parameter."""
    if samples < 3:
        return 1.0
    quantile = float(stdtrit(samples - 2, 1.0 - level / max(parameters, 1) / 2.0))
    return quantile / math.sqrt(samples - 2 + quantile**2)


def made_with(made: Mapping[str, Any]) -> str:
    """What a variant is made with, in one line."""
    return ", ".join(
        f"step {value:g} s" if name == "step" else str(value)
        for name, value in made.items()
        if value not in (None, "")
    )


@dataclass(frozen=True)
class Sensitivity:
    """Indices of one result over the samples of one variant.

    Attributes:
        made: what the runs have in common, by columns of the table.
        output: column of the table.
        unit: of it.
        method: of `[sample]`.
        indices: parameter -> name of the index -> value. Names as in SALib (`S1`, `ST`, `mu_star`,
            `sigma`, with `_conf` half the width of the interval of 95 %); `correlation` of ranks.
        limit: magnitude of a correlation from which it is more than chance; None of the others.
        runs: that counted.
        lost: runs that did not, as they or one of their block failed.
    """

    made: Mapping[str, Any]
    output: str
    unit: str
    method: str
    indices: Mapping[str, Mapping[str, float]]
    limit: float | None
    runs: int
    lost: int

    @property
    def main(self) -> str:
        """The index that parameters are ordered by."""
        return {"sobol": "ST", "morris": "mu_star"}.get(self.method, "correlation")

    def half_width(self, parameter: str) -> float | None:
        """Of the interval of the main index."""
        return self.indices[parameter].get(f"{self.main}_conf")

    def significant(self, parameter: str) -> bool:
        """Whether a parameter does more than chance."""
        value = self.indices[parameter][self.main]
        if self.limit is not None:
            return abs(value) > self.limit
        return value > (self.half_width(parameter) or 0.0)

    def ordered(self) -> list[str]:
        """Parameters, the one with the largest index first."""
        return sorted(self.indices, key=lambda name: -abs(self.indices[name][self.main]))

    def sentence(self) -> str:
        """The parameters with their main index, one line."""
        parts = []
        for name in self.ordered():
            width = self.half_width(name)
            interval = f" ± {width:.2g}" if width is not None else ""
            chance = "" if self.significant(name) else " (chance)"
            parts.append(f"{name} {self.indices[name][self.main]:.3g}{interval}{chance}")
        made = f" ({made_with(self.made)})" if self.made else ""
        unit = f" [{self.unit}]" if self.unit and self.method == "morris" else ""
        lost = f"; {self.lost} runs of incomplete blocks left out" if self.lost else ""
        return f"{self.output}{made}: {self.main}{unit} of {', '.join(parts)}{lost}"

    def rows(self) -> list[dict[str, Any]]:
        """One row per parameter."""
        common = {**self.made, "output": self.output, "unit": self.unit, "method": self.method}
        end = {"limit": self.limit, "runs": self.runs, "lost": self.lost}
        return [
            {**common, "parameter": n, **self.indices[n], "significant": self.significant(n), **end}
            for n in self.ordered()
        ]


@dataclass(frozen=True)
class Samples:
    """The runs of one variant over all samples, in the order of the design.

    Attributes:
        made: what they have in common.
        values: sampled parameter -> its value in each run.
        rows: of the table; None for a run that is not there or failed.
    """

    made: Mapping[str, Any]
    values: Mapping[str, Vector]
    rows: Sequence[Mapping[str, Any] | None] = field(default_factory=list)

    def output(self, name: str) -> Vector:
        """A column; NaN where there is none."""
        cells = [row.get(name) if row else None for row in self.rows]
        return np.array([math.nan if cell is None else float(cell) for cell in cells])


def samples_of(study: Study, table: StudyTable, points: Sequence[str]) -> list[Samples]:
    """The runs over the samples, of each variant.

    Args:
        study: with sampled parameters.
        table: its runs.
        points: key of the run of each point of the study.
    """
    assert study.sample is not None  # asked only where there is one
    sampled = study.sampled
    rows = {row["key"]: row for row in table.rows if row["status"] == "ok"}
    count = study.sample.count
    if study.sample.method in DESIGNS:
        count *= block(study.sample.method, len(sampled))
    varied = [n for n in table.varied if n.removeprefix("param.") not in sampled]
    found = []
    for begin in range(0, len(points), count):
        members = [rows.get(key) for key in points[begin : begin + count]]
        first = next((row for row in members if row), None)
        if first is None:
            continue
        columns = {name: [row.get(f"param.{name}") if row else None for row in members]
                   for name in sampled}  # fmt: skip
        values = {  # a variant that lacks a parameter has no values of it
            name: np.array([math.nan if v is None else v for v in column], dtype=float)
            for name, column in columns.items()
            if any(v is not None for v in column)
        }
        found.append(Samples({name: first.get(name) for name in varied}, values, members))
    return found


def outputs(table: StudyTable) -> list[str]:
    """Columns of results: errors and values of checks."""
    checks = [name for name in table.columns if name.startswith("check.")]
    return [*(name for name in table.errors if name.startswith(ERRORS)), *checks]


def sensitivities(study: Study, table: StudyTable, points: Sequence[str]) -> list[Sensitivity]:
    """Indices of every result of every variant; results that do not vary have none."""
    assert study.sample is not None
    found = []
    for samples in samples_of(study, table, points):
        for name in outputs(table):
            item = _one(study, samples, name, table.units.get(name, ""))
            if item is not None:
                found.append(item)
    return found


def _one(study: Study, samples: Samples, name: str, unit: str) -> Sensitivity | None:
    assert study.sample is not None
    method, seed = study.sample.method, study.sample.seed
    designed = method in DESIGNS
    all_of = list(study.sampled) if designed else list(samples.values)
    y = samples.output(name)
    size = block(method, len(all_of))
    whole = np.isfinite(y).reshape(-1, size).all(axis=1)
    kept = np.repeat(whole, size)
    used = y[kept]
    if whole.sum() < FEWEST or not np.ptp(used) > 0.0:
        return None
    if method == "sobol":
        result = salib("analyze", "sobol").analyze(
            problem(len(all_of)), used, calc_second_order=False, num_resamples=RESAMPLES, seed=seed
        )
        names: tuple[str, ...] = ("S1", "S1_conf", "ST", "ST_conf")
    elif method == "morris":
        result = salib("analyze", "morris").analyze(
            problem(len(all_of)), DESIGNS[method](study.sample, len(all_of))[kept], used,
            num_levels=LEVELS, num_resamples=RESAMPLES, seed=seed,
        )  # fmt: skip
        names = ("mu", "mu_star", "mu_star_conf", "sigma")
    else:
        from scipy.stats import rankdata  # slow to import

        ranks = rankdata(used)
        columns = np.array([rankdata(samples.values[n][kept]) for n in all_of])
        result = {"correlation": [float(np.corrcoef(x, ranks)[0, 1]) for x in columns]}
        names = ("correlation",)
    indices = {
        parameter: {index: float(result[index][i]) for index in names}
        for i, parameter in enumerate(all_of)
        if parameter in samples.values
    }
    limit = None if designed else significance_limit(len(used), len(all_of))
    return Sensitivity(
        samples.made, name, unit, method, indices, limit, len(used), len(y) - len(used)
    )


def write_csv(found: Sequence[Sensitivity], path: Path) -> Path:
    """Write one row per result and parameter."""
    rows = [row for item in found for row in item.rows()]
    columns = list(dict.fromkeys(name for row in rows for name in row))
    with atomic(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(rows)
    return path
