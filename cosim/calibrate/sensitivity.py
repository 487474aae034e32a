"""Which parameters the data depend on.

    local:        rms over samples and channels of d(model)/d(parameter) * span / sigma
    correlation:  over random parameter sets, correlation of the parameter with the root mean square
                  residual, in [-1, 1] (tornado plot)

An index is significant if it exceeds the limit for this number of samples, divided among the
parameters (Bonferroni); rankings below the limit are noise.

Source: digital twin paper (correlation index, tornado plot).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..display.literal import literal
from ..errors import FmuCallError
from ..files import atomic
from ..study.sensitivity import significance_limit
from .estimate import Estimate
from .simulator import Simulator

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Correlation:
    """Correlation of parameters with the cost.

    Attributes:
        index: parameter -> correlation.
        limit: magnitude above which one of them is significant at 5 % over all.
        samples: parameter sets that could be simulated.
        by_run: run -> the same for its residual alone.
    """

    index: Mapping[str, float]
    limit: float
    samples: int
    by_run: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


def correlation_index(
    simulator: Simulator,
    theta: Vector,
    samples: int = 64,
    *,
    width: float = 0.5,
    seed: int = 0,
    everywhere: bool = False,
) -> Correlation:
    """Correlate declared parameters with the residual over random parameter sets.

    Args:
        simulator: of the problem, whose identification runs count.
        theta: centre of the sets, and the values of all other parameters.
        samples: parameter sets.
        width: half width of the sets' range over the parameters' spans.
        seed: of the Latin hypercube.
        everywhere: look at the validation runs, too, one by one.
    """
    from scipy.stats import qmc  # slow to import

    problem = simulator.problem
    chosen = [i for i, p in enumerate(problem.parameters) if p.role != "nuisance" and not p.run]
    cube = qmc.LatinHypercube(len(chosen), rng=seed).random(samples) * 2.0 - 1.0
    fitted = {run.name for run in problem.chosen("identification")}
    purpose = None if everywhere else "identification"
    sets, costs = [], []
    singly: dict[str, list[float]] = {run.name: [] for run in problem.chosen(purpose)}
    for row in cube:
        moved = theta.copy()
        moved[chosen] += width * row * problem.scale[chosen]
        moved = np.clip(moved, problem.lower, problem.upper)
        try:
            residuals = simulator.residuals(moved, purpose)
        except FmuCallError:
            continue
        squares = {name: r[np.isfinite(r)] ** 2 for name, r in residuals}
        sets.append(moved[chosen])
        costs.append(_root_mean([v for name, v in squares.items() if name in fitted]))
        for name, values in squares.items():
            singly[name].append(_root_mean([values]))
    names = [problem.names[i] for i in chosen]
    moved_sets = np.array(sets).reshape(len(sets), len(chosen))
    return Correlation(
        _correlated(names, moved_sets, costs),
        significance_limit(len(sets), len(chosen)),
        len(sets),
        {run: _correlated(names, moved_sets, found) for run, found in singly.items()},
    )


def _root_mean(squares: list[Vector]) -> float:
    return math.sqrt(float(np.mean(np.concatenate(squares))))


def _correlated(names: list[str], sets: Vector, costs: list[float]) -> dict[str, float]:
    """Parameter -> its correlation with the costs, 0 where either does not vary."""
    index = {}
    for name, values in zip(names, sets.T, strict=True):
        varies = len(sets) > 2 and np.std(values) > 0.0 and np.std(costs) > 0.0
        index[name] = float(np.corrcoef(values, costs)[0, 1]) if varies else 0.0
    return index


def local(estimate: Estimate) -> dict[str, float]:
    """Root mean square change of the channels, in sigma, for a change by the whole span."""
    problem = estimate.problem
    squares, count = np.zeros(len(problem.parameters)), np.zeros(len(problem.parameters))
    for item in estimate.jacobian:
        squares[item.columns] += np.nansum(item.values**2, axis=(0, 1))
        count[item.columns] += np.isfinite(item.values).sum(axis=(0, 1))
    rms = np.sqrt(squares / np.maximum(count, 1.0)) * problem.scale
    return {
        name: float(value)
        for name, value, p in zip(problem.names, rms, problem.parameters, strict=True)
        if p.role != "nuisance"
    }


def tornado(correlation: Correlation, path: Path) -> Path:
    """Draw the indices, largest first, with the significance limit."""
    from matplotlib.figure import Figure

    items = sorted(correlation.index.items(), key=lambda item: abs(item[1]))
    figure = Figure(figsize=(6.0, 1.2 + 0.3 * len(items)), layout="constrained")
    axes = figure.subplots()
    colors = ["tab:blue" if abs(v) > correlation.limit else "0.75" for _, v in items]
    axes.barh([name for name, _ in items], [value for _, value in items], color=colors)
    for side in (-1.0, 1.0):
        axes.axvline(side * correlation.limit, color="tab:red", linestyle="--", linewidth=1.0)
    axes.set_xlim(-1.0, 1.0)
    axes.set_xlabel(f"correlation with the residual, {correlation.samples} sets; dashed: 5 % limit")
    with atomic(path) as temporary:
        literal(figure).savefig(temporary, dpi=120)
    return path
