"""Declared parameters that may differ between runs: fitted to each run, do they leave noise?

A payload that was taken off, a battery that was changed, grease that has warmed up over night:
nothing in one run tells of them, so no law of the catalogue fits. A value of its own for each run
is no law either, since it foretells nothing of the next run; it says which value to look at.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..calibrate.deferred import corrected
from ..calibrate.differences import jacobian
from ..calibrate.estimate import Estimate
from ..calibrate.fit import CORRECTION, Effort, fit
from ..calibrate.parts import Parameter
from ..calibrate.simulator import Simulator
from ..errors import CosimError
from .answer import over, percent
from .doubts import threshold
from .facts import Left, Value
from .linear import Absorber
from .models import GATE_Z, Fitted, compare, value_of
from .search import Search
from .table import left_of
from .values import Values, exact
from .verdict import HALF, TENTH, above_noise

Vector = NDArray[np.float64]
CLOSE = 0.9
"""Share of what the best parameter explains to first order from which others are fitted, too: first
orders of values that differ by a few per cent are right to a few per cent."""
MOST = 3
"""Parameters that are fitted by run at most: each takes a fit with as many parameters as runs."""
CLOSELY = Effort("near")
"""To the minimum: values may differ by tens of per cent, and what is left must be told from noise.
"""


@dataclass(frozen=True)
class ByRun:
    """A declared parameter that was fitted to each run.

    Attributes:
        parameter, unit: which.
        explained: share of what the declared model leaves beyond noise.
        values: by run, with their intervals; as wide as bounds where a run does not tell.
        left: what stays above noise.
        cost: half the sum of squares over the noise that it leaves in all runs [nats].
    """

    parameter: str
    unit: str
    explained: float
    values: dict[str, Value]
    left: tuple[Left, ...]
    cost: float

    @property
    def sentence(self) -> str:
        """What is said of it."""
        told = {run: v.value for run, v in self.values.items() if v.determined}
        least, most = (end(told, key=told.__getitem__) for end in (min, max))
        unit = f" {self.unit}" if self.unit not in ("", "1", "-") else ""
        rest = f"leave more than noise in {over(self.left)}" if self.left else "leave noise"
        return (
            f"One value of {self.parameter} for each run, from {told[least]:.4g} in {least} "
            f"to {told[most]:.4g}{unit} in {most}, would explain {percent(self.explained)} "
            f"and {rest}: look for what differs between the runs."
        )

    def to_dict(self) -> dict[str, Any]:
        """As in the JSON."""
        return {
            "parameter": self.parameter, "unit": self.unit, "explained": self.explained,
            "values": {
                run: {"value": v.value, "unit": v.unit, "ci95": [v.low, v.high],
                      "identifiable": v.identifiable}
                for run, v in self.values.items()
            },
            "left": list(dict.fromkeys(x.channel for x in self.left)),
        }  # fmt: skip


def by_run(search: Search, base: Fitted) -> list[ByRun]:
    """Declared parameters of which a value for each run leaves noise, or a tenth (RMS) of the rest.

    The best first, and those that the data do not tell from it. Unused runs have to want it: there,
    too, the value is fitted to the run, and must gain more than a parameter does by chance.

    Args:
        search: its runs.
        base: the declared model.
    """
    if search.raw.late or not search.unused or len(search.fitting.runs) < 2:
        return []
    found = []
    for parameter in _promising(search, base):
        search.say(f"does {parameter.name} differ between runs?")
        try:
            item = _fitted(search, base, parameter)
        except CosimError as error:
            search.say(f"{parameter.name} cannot be fitted to each run: {error}")
            continue
        if item is not None:
            found.append(item)
    found.sort(key=lambda item: item.cost)
    need = threshold(len(base.problem.parameters))
    return [item for item in found if item.cost < found[0].cost + need]


def _promising(search: Search, base: Fitted) -> list[Parameter]:
    """Those that explain most of what is left to first order, the best first.

    In unused runs, too, where nothing makes up for a value but the runs' own ones.
    """
    problem, theta = base.problem, base.estimate.theta
    declared = [i for i, p in enumerate(problem.parameters) if p.role == "declared" and not p.run]
    names = search.checking.names
    own = [i for i, p in enumerate(problem.parameters) if p.run in names]
    known = {item.run: item for item in base.estimate.jacobian}
    known |= {
        item.run: item
        for item in jacobian(base.simulator, theta, names, columns=[*declared, *own], central=False)
    }
    gains, beyond = dict.fromkeys(declared, 0.0), 0.0
    for stack, left in (
        (search.fitting, search.fit_data - base.fit),
        (search.checking, search.check_data - base.check),
    ):
        matrix = stack.matrix([known[n] for n in stack.names], problem.scale)
        taken = matrix
        if stack is search.checking:
            taken = matrix * np.isin(np.arange(theta.size), own)
        absorber = Absorber(taken, problem, base.estimate.at_bound)
        rest = absorber.rest(left)
        beyond += max(0.5 * (float(rest @ rest) - rest.size), 0.0)
        for i in declared:
            ways = [absorber.rest(matrix[:, i] * (stack.run == k)) for k in range(len(stack.runs))]
            vectors, sizes, _ = np.linalg.svd(np.column_stack(ways), full_matrices=False)
            shares = vectors[:, sizes > 1.0].T @ rest  # less than the noise over the whole span
            gains[i] += 0.5 * float(shares @ shares)
    best = max(gains.values(), default=0.0)
    chosen = sorted((i for i in gains if gains[i] >= CLOSE * best), key=lambda i: -gains[i])
    return [problem.parameters[i] for i in chosen[:MOST]] if best >= HALF * beyond else []


def _all_runs(
    search: Search, simulator: Simulator, start: Vector, unused: list[str], effort: Effort
) -> tuple[Vector, list[Estimate]]:
    """Parameters of a fit, those of unused runs fitted to these with all others held; both fits."""
    problem = simulator.problem
    estimate = fit(simulator, start, effort=effort)
    kept = {
        p.name: float(value)
        for p, value in zip(problem.parameters, estimate.theta, strict=True) if p.run not in unused
    }  # fmt: skip
    inner = simulator.of(problem.hold(kept))
    begin = np.array([v for n, v in zip(problem.names, start, strict=True) if n not in kept])
    later = fit(inner, begin, unused, effort=effort)
    search.evaluations += estimate.evaluations + later.evaluations
    return np.array([{**kept, **later.values}[name] for name in problem.names]), [estimate, later]


def _fitted(search: Search, base: Fitted, parameter: Parameter) -> ByRun | None:
    """A parameter fitted to each run; None if unused runs do not want that, or more is left."""
    problem, place = base.problem, base.problem.index(parameter.name)
    own = [
        replace(parameter, name=f"{parameter.name}@{run.name}", run=run.name, role="nuisance")
        for run in problem.runs
    ]
    others = [p for p in problem.parameters if p is not parameter]
    wide = problem.with_parameters([*others, *own])
    start = np.concatenate(
        [np.delete(base.estimate.theta, place), np.repeat(base.estimate.theta[place], len(own))]
    )
    unused = [run.name for run in search.checking.runs]
    theta, _ = _all_runs(search, base.simulator.of(wide), start, unused, CLOSELY)
    simulator = search.simulator.of(search.raw.with_parameters(wide.parameters))
    simulator = corrected(simulator, theta, search.raw)
    theta, fits = _all_runs(search, simulator, theta, unused, CORRECTION)
    fitted, checked = (
        exact(simulator, theta, search.raw, stack) for stack in (search.fitting, search.checking)
    )
    found = Fitted((), fits[0], Values(fitted, checked))
    gate = compare(search.check_data, base.check, checked, search.checking)
    costs = [
        search.fitting.cost(search.fit_data - f.fit)
        + search.checking.cost(search.check_data - f.check)
        for f in (base, found)
    ]
    beyond = costs[0] - 0.5 * (search.fitting.size + search.checking.size)
    explained = (costs[0] - costs[1]) / beyond if beyond > 0.0 else 0.0
    need = threshold(len(problem.parameters)) + len(unused)  # a nat for each value
    if gate.gain < need or gate.z < GATE_Z:
        return None
    values = {p.run: value_of(p, fits[p.run in unused]) for p in own}
    if sum(v.determined for v in values.values()) < 2:
        return None
    left = above_noise(left_of(search, found), named=True)
    if left and explained < 1.0 - TENTH**2:  # a law that acts otherwise in each run shows so, too
        return None
    return ByRun(parameter.name, parameter.unit, min(explained, 1.0), values, left, costs[1])
