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
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

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
    """

    index: Mapping[str, float]
    limit: float
    samples: int


def correlation_index(
    simulator: Simulator, theta: Vector, samples: int = 64, *, width: float = 0.5, seed: int = 0
) -> Correlation:
    """Correlate declared parameters with the residual over random parameter sets.

    Args:
        simulator: of the problem, whose identification runs count.
        theta: centre of the sets, and the values of all other parameters.
        samples: parameter sets.
        width: half width of the sets' range over the parameters' spans.
        seed: of the Latin hypercube.
    """
    problem = simulator.problem
    chosen = [i for i, p in enumerate(problem.parameters) if p.role != "nuisance" and not p.run]
    cube = qmc.LatinHypercube(len(chosen), rng=seed).random(samples) * 2.0 - 1.0
    sets, costs = [], []
    for row in cube:
        moved = theta.copy()
        moved[chosen] += width * row * problem.scale[chosen]
        moved = np.clip(moved, problem.lower, problem.upper)
        try:
            residuals = simulator.residuals(moved)
        except FmuCallError:
            continue
        squares = np.concatenate([r[np.isfinite(r)] for _, r in residuals]) ** 2
        sets.append(moved[chosen])
        costs.append(math.sqrt(float(np.mean(squares))))
    index = {}
    for place, i in enumerate(chosen):
        values = np.array([item[place] for item in sets])
        varies = len(sets) > 2 and np.std(values) > 0.0 and np.std(costs) > 0.0
        index[problem.names[i]] = float(np.corrcoef(values, costs)[0, 1]) if varies else 0.0
    return Correlation(index, significance_limit(len(sets), len(chosen)), len(sets))


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
        figure.savefig(temporary, dpi=120)
    return path
