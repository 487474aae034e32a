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

if TYPE_CHECKING:
    from ..problem import Problem
    from ..simulator import Simulator

Vector = NDArray[np.float64]
WORSE = 10.0
"""Times as large as in the other one's place is the mean square misfit of an exchanged column."""
CHANCE = 0.01
"""Share of logs without exchanged runs in which two may look exchanged."""
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
            if crossed < (1.0 / WORSE if alike else UNLIKE) * straight or mixed:
                text = (
                    f"each fits the other's signal ({second.signal}, {first.signal}) far better: "
                    "the two columns look swapped"
                )
                yield Finding("error", "swapped", "", f"{first.name} and {second.name}", text)


def _differs(problem: Problem, models: Mapping[str, Vector], a: int, b: int) -> bool:
    """Whether what two columns differ by follows the model with the sign turned round.

    What is common to both (the currents of two wheels that carry one base) hides an exchange. All
    runs together decide: a place that begins at another heading turns x - y round in one of them.
    """
    pairs = []
    for run in problem.runs:
        measured = run.data[:, a] - run.data[:, b]
        simulated = models[run.name][:, a] - models[run.name][:, b]
        good = np.isfinite(measured) & np.isfinite(simulated)
        measured, simulated = measured[good], simulated[good]
        if measured.size >= 2 and np.std(simulated) >= 5.0 * problem.channels[a].sigma:
            pairs.append((measured - np.mean(measured), simulated - np.mean(simulated)))
    if not pairs:
        return False
    measured, simulated = (np.concatenate(one) for one in zip(*pairs, strict=True))
    size = np.sqrt((measured @ measured) * (simulated @ simulated))
    return bool(measured @ simulated < -FOLLOWS * size)


def check_runs(problem: Problem, models: Mapping[str, Vector]) -> Iterator[Finding]:
    """Columns that two runs have exchanged: each fits the other's signal `WORSE` times better.

    As for two channels, over all samples, but for each of the two runs; no other column of them
    does. Of many short runs some are alike by chance, and a model that is off is so in most of
    them: both fit their own signal as much worse, too, than the other runs do (median), and the
    better fit counts more nats (of a noise of unknown size) than that of the best pair does by
    chance once in a hundred logs. So runs with a single sample tell next to nothing.
    """
    every = range(len(problem.channels))
    pairs = max(0.5 * len(problem.runs) * (len(problem.runs) - 1) * len(every), 1.0)
    sizes = np.array([np.count_nonzero(np.isfinite(r.data), axis=0) for r in problem.runs])
    own = np.array([_mean_squares(r.data, models[r.name], problem.sigma) for r in problem.runs])
    # no median of all runs but two is less; it is 0 of none
    least = np.sort(np.nan_to_num(own), axis=0)[(len(own) - 3) // 2] if len(own) > 2 else 0.0
    suspect = [k for k, square in enumerate(own) if np.any(square > WORSE * least)]
    for place, a in enumerate(suspect):
        for b in suspect[place + 1 :]:
            first, second = problem.runs[a], problem.runs[b]
            usual = _medians(np.delete(own, (a, b), axis=0))
            apart = np.minimum(own[a], own[b]) > WORSE * usual
            if not np.any(apart):
                continue
            # a fit that is better than the noise is so by chance
            one = own[a] / np.maximum(_crossed(problem, models, first, second), 1.0)
            other = own[b] / np.maximum(_crossed(problem, models, second, first), 1.0)
            crossed = [
                apart[i] and min(one[i], other[i]) > WORSE
                and sizes[a, i] * np.log(one[i]) + sizes[b, i] * np.log(other[i])
                > 2.0 * np.log(pairs / CHANCE)
                for i in every
            ]  # fmt: skip
            if sum(crossed) != 1 or len(crossed) < 2:
                continue  # none, or whole runs
            channel = problem.channels[crossed.index(True)]
            text = (
                f"is exchanged with that of run {second.name}: each follows {channel.signal} as it "
                "is in the other one, and no other column does"
            )
            yield Finding("error", "swapped", first.name, channel.name, text)


def _mean_squares(data: Vector, model: Vector, sigma: Vector) -> Vector:
    """Of each column's misfit over its noise; NaN of one that was not measured."""
    size = min(len(data), len(model))
    apart = (data[:size] - model[:size]) / sigma
    counts = np.isfinite(apart).sum(axis=0)
    return np.where(counts > 0, np.nansum(apart**2, axis=0) / np.maximum(counts, 1), np.nan)


def _medians(rows: Vector) -> Vector:
    """Of each column, without what was not measured; 0 of none."""
    return np.array([np.median(c[np.isfinite(c)]) if np.any(np.isfinite(c)) else 0.0
                     for c in rows.T])  # fmt: skip


def _crossed(
    problem: Problem, models: Mapping[str, Vector], run: MeasuredRun, other: MeasuredRun
) -> Vector:
    """Of a run's columns the mean square of the misfit to the other run's signals."""
    return _mean_squares(run.data, models[other.name], problem.sigma)


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
    costs = {run.name: _cost(problem, run, models[run.name]) for run in problem.runs}
    run = max(problem.runs, key=lambda item: costs[item.name])
    if costs[run.name] < 10.0 * run.data.size:
        return

    def exchanged(run: MeasuredRun, first: str, second: str) -> float:
        """What the inputs leave in each other's place, over what they leave."""
        inputs = {**run.inputs, first: run.inputs[second], second: run.inputs[first]}
        trial = simulator.of(problem.only([run.name]).changed(runs=[replace(run, inputs=inputs)]))
        try:
            model = trial.simulate(theta[problem.columns(run.name)], run.name)
        except CosimError:
            return np.inf
        finally:
            trial.close()
        return _cost(problem, run, model) / max(costs[run.name], 1e-300)

    names = [name for name in run.inputs if "[" not in name]
    for a, first in enumerate(names):
        for second in names[a + 1 :]:
            if exchanged(run, first, second) < 1.0 / WORSE:
                columns = [run.inputs[n].text.rpartition(":")[2] for n in (first, second)]
                others = [
                    r for r in problem.runs if r is not run and {first, second} <= {*r.inputs}
                ]
                alone = any(exchanged(other, first, second) > WORSE for other in others)
                text = "explain the data far better exchanged: the two columns look swapped"
                where = run.name if alone else ""
                text += ", in this run and not in all others" * alone
                yield Finding("error", "swapped", where, " and ".join(columns), text)


def _cost(problem: Problem, run: MeasuredRun, model: Vector) -> float:
    return float(np.nansum(((run.data - model) / problem.sigma) ** 2))
