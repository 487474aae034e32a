"""Columns that are exchanged: of two channels, of two inputs, or of two runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...errors import CosimError
from ..parts import MeasuredRun
from .finding import Finding
from .scale import FOLLOWS
from .times import SHORT

if TYPE_CHECKING:
    from ..problem import Problem
    from ..simulator import Simulator

Vector = NDArray[np.float64]
UNLIKE = 0.01
"""Share of the misfit that columns of different units must keep when exchanged: their numbers are
alike by chance only."""


def check_channels(
    problem: Problem, models: Mapping[str, Vector], named: set[str]
) -> Iterator[Finding]:
    """Pairs of channels that fit each other's signal far better than their own.

    Ten times better (a hundred times where the units differ) over all samples is not of chance, and
    no law that a model lacks makes one column what the other should be.

    Args:
        problem, models: data, and what the model gives.
        named: channels about which something was found that explains as much.
    """
    for a, first in enumerate(problem.channels):
        for b in range(a + 1, len(problem.channels)):
            second = problem.channels[b]
            if {first.name, second.name} & named:
                continue
            straight = _misfit(problem, models, a, a) + _misfit(problem, models, b, b)
            crossed = _misfit(problem, models, a, b) + _misfit(problem, models, b, a)
            alike = first.unit == second.unit
            mixed = alike and crossed < straight and _differs(problem, models, a, b)
            if crossed < (0.1 if alike else UNLIKE) * straight or mixed:
                text = (
                    f"each fits the other's signal ({second.signal}, {first.signal}) far better: "
                    "the two columns look swapped"
                )
                yield Finding("error", "swapped", "", f"{first.name} and {second.name}", text)


def _differs(problem: Problem, models: Mapping[str, Vector], a: int, b: int) -> bool:
    """Whether what two columns differ by follows the model with the sign turned round.

    What is common to both (the currents of two wheels that carry one base) hides an exchange.
    """
    signs = []
    for run in problem.runs:
        measured = run.data[:, a] - run.data[:, b]
        simulated = models[run.name][:, a] - models[run.name][:, b]
        good = np.isfinite(measured) & np.isfinite(simulated)
        measured, simulated = measured[good], simulated[good]
        if measured.size < 2 or np.std(simulated) < 5.0 * problem.channels[a].sigma:
            continue
        if np.std(measured) > 0.0:
            correlation = float(np.corrcoef(measured, simulated)[0, 1])
            if abs(correlation) > FOLLOWS:
                signs.append(correlation)
    return sum(c < 0.0 for c in signs) > 0.5 * max(len(signs), 1)


def check_runs(problem: Problem, models: Mapping[str, Vector]) -> Iterator[Finding]:
    """Columns that follow their signal in another run and not in their own.

    All other columns of the run must follow it: no law that a model lacks makes one column of a run
    what it is in another one (a correlation beyond `FOLLOWS` over hundreds of samples is not of
    chance), and a column that comes from elsewhere does not move what the others show.
    """
    for run in problem.runs:
        own = [_follows(run, models[run.name], i) for i in range(len(problem.channels))]
        for index, channel in enumerate(problem.channels):
            others = [c for i, c in enumerate(own) if i != index and c is not None]
            mine = own[index]
            if mine is None or mine > FOLLOWS or any(c < FOLLOWS for c in others):
                continue
            for other in problem.runs:
                there = _follows(run, models[other.name], index)
                if other is run or there is None or there < FOLLOWS or not others:
                    continue
                text = (
                    f"follows {channel.signal} as it is in run {other.name}, and not as it is in "
                    "this one, which its other columns follow: the column of another run"
                )
                yield Finding("error", "mixed", run.name, channel.name, text)


def _follows(run: MeasuredRun, model: Vector, index: int) -> float | None:
    """Correlation of a column with its signal in a run, None where one of them does not move."""
    size = min(len(model), len(run.data))
    measured, simulated = run.data[:size, index], model[:size, index]
    good = np.isfinite(measured) & np.isfinite(simulated)
    measured, simulated = measured[good], simulated[good]
    if measured.size < SHORT or np.std(measured) == 0.0 or np.std(simulated) == 0.0:
        return None
    return float(np.corrcoef(measured, simulated)[0, 1])


def _misfit(problem: Problem, models: Mapping[str, Vector], data: int, model: int) -> float:
    sigma = problem.channels[model].sigma
    total = 0.0
    for run in problem.runs:
        difference = run.data[:, data] - models[run.name][:, model]
        total += float(np.nansum((difference / sigma) ** 2))
    return total


def check_inputs(
    simulator: Simulator, models: Mapping[str, Vector], theta: Vector
) -> Iterator[Finding]:
    """Pairs of inputs that explain the data far better when exchanged."""
    problem = simulator.problem
    run = max(problem.runs, key=lambda item: _cost(problem, item, models[item.name]))
    straight = _cost(problem, run, models[run.name])
    if straight < 10.0 * run.data.size:
        return
    names = [name for name in run.inputs if "[" not in name]
    for a, first in enumerate(names):
        for second in names[a + 1 :]:
            exchanged = {**run.inputs, first: run.inputs[second], second: run.inputs[first]}
            trial = simulator.of(
                problem.only([run.name]).changed(runs=[replace(run, inputs=exchanged)])
            )
            try:
                model = trial.simulate(theta[problem.columns(run.name)], run.name)
            except CosimError:
                continue
            finally:
                trial.close()
            if _cost(problem, run, model) < 0.1 * straight:
                columns = [run.inputs[n].text.rpartition(":")[2] for n in (first, second)]
                text = f"and {columns[1]} explain the data far better exchanged: swapped columns"
                yield Finding("error", "swapped", "", columns[0], text)


def _cost(problem: Problem, run: MeasuredRun, model: Vector) -> float:
    return float(np.nansum(((run.data - model) / problem.sigma) ** 2))
