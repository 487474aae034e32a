"""Looks for what is wrong with a data set before anything is fitted; lists all problems at once.

`check_data` needs the log only. `check_model` compares it with the model at nominal values: a
column that follows the model with the wrong sign or scale, another column's signal, or a shifted
clock.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import CosimError
from .parts import MeasuredRun
from .problem import Problem
from .simulator import Simulator

Vector = NDArray[np.float64]
SHORT = 50
"""Fewer samples than this are no run."""
FOLLOWS = 0.9
"""Correlation from which a column counts as following a signal."""
STRANGE = 8.0
"""A column that is so many times too large is no measurement of the signal. By less, it may be
what the model lacks, unless the factor is one of those below: cold grease triples a current."""
FACTORS = {
    "degrees instead of radians": 180.0 / np.pi,
    "radians instead of degrees": np.pi / 180.0,
    "rpm instead of rad/s": 30.0 / np.pi,
    "rad/s instead of rpm": np.pi / 30.0,
    "thousandths of the unit": 1e3,
    "a thousand times the unit": 1e-3,
    "hundredths of the unit": 1e2,
    "a hundred times the unit": 1e-2,
    "turns instead of radians": 0.5 / np.pi,
    "radians instead of turns": 2.0 * np.pi,
}


@dataclass(frozen=True)
class Finding:
    """A problem of a data set.

    Attributes:
        severity: `error` (cannot be used) or `warning`.
        kind: short name of the problem.
        run, column: where; "" for all.
        text: the reason.
    """

    severity: str
    kind: str
    run: str
    column: str
    text: str

    def __str__(self) -> str:
        where = " ".join(item for item in (f"run {self.run}" if self.run else "", self.column)
                         if item)  # fmt: skip
        return f"{self.severity}: {where}: {self.text}"

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"severity": self.severity, "kind": self.kind, "run": self.run,
                "column": self.column, "text": self.text}  # fmt: skip


def check_data(problem: Problem) -> list[Finding]:
    """Problems of the logs alone."""
    found: list[Finding] = []
    if not problem.chosen("identification"):
        found.append(Finding("error", "purpose", "", "", "no run is for identification"))
    for run in problem.runs:
        found += _check_times(run)
        found += _check_columns(problem, run)
    for index, channel in enumerate(problem.channels):
        values = np.concatenate([run.data[:, index] for run in problem.runs])
        values = values[np.isfinite(values)]
        if not values.size:
            text = "has no values in any run"
            found.append(Finding("error", "empty", "", channel.name, text))
        elif np.ptp(values) == 0.0:
            text = f"is {values[0]:g} {channel.unit} in all runs: a constant channel says nothing"
            found.append(Finding("error", "constant", "", channel.name, text))
    return found


def _check_times(run: MeasuredRun) -> Iterator[Finding]:
    steps = np.diff(run.times)
    if run.times.size < SHORT:
        text = f"has {run.times.size} samples; a run needs {SHORT} or more"
        yield Finding("error", "short", run.name, "time", text)
        return
    if np.any(steps <= 0.0):
        at = run.times[int(np.flatnonzero(steps <= 0.0)[0])]
        text = f"does not increase after {at:.6g} s"
        yield Finding("error", "clock", run.name, "time", text)
    interval = float(np.median(steps))
    if np.max(steps) > 5.0 * interval:
        at = run.times[int(np.argmax(steps))]
        text = f"has a gap of {np.max(steps):.4g} s after {at:.6g} s (interval {interval:.4g} s)"
        yield Finding("warning", "gap", run.name, "time", text)
    if interval > 0.0 and np.std(steps) > 0.2 * interval:
        text = f"jitters: intervals {interval:.4g} s with a deviation of {np.std(steps):.2g} s"
        yield Finding("warning", "jitter", run.name, "time", text)


def _check_columns(problem: Problem, run: MeasuredRun) -> Iterator[Finding]:
    for name, signal in run.inputs.items():
        values = np.asarray(signal.at(run.times))
        if np.ptp(values) == 0.0:
            text = f"drives {name} with {values[0]:g} throughout: this run excites nothing there"
            yield Finding("warning", "constant", run.name, signal.text.rpartition(":")[2], text)
    for index, channel in enumerate(problem.channels):
        values = run.data[:, index]
        good = np.isfinite(values)
        if good.any() and good.mean() < 0.5:
            text = f"lacks {1 - good.mean():.0%} of its samples"
            yield Finding("warning", "gaps", run.name, channel.name, text)
        values = values[good]
        if values.size < SHORT:
            continue
        # noise alone makes equal neighbours rare, unless it is finer than the rounding
        changes = np.flatnonzero(np.diff(values) != 0.0)
        edges = np.concatenate([[-1], changes, [values.size - 1]])
        longest = int(np.max(np.diff(edges)))
        usual = float(np.mean(np.diff(edges)))
        if changes.size and longest > max(SHORT, 20.0 * usual) and longest > 0.02 * values.size:
            start = int(edges[int(np.argmax(np.diff(edges)))]) + 1
            text = (
                f"stands at {values[start]:.6g} {channel.unit} for {longest} samples from "
                f"{run.times[good][start]:.4g} s on, "
            )
            # rounding hides noise that is smaller than the quantum: a machine at rest reads so,
            # too; and it comes back to the value that it rests at, which no frozen sensor does
            quantum = float(np.min(np.abs(np.diff(values)[changes])))
            lasting = edges[:-1][np.diff(edges) > SHORT] + 1
            again = int(np.sum(values[lasting] == values[start])) > 1
            if quantum > channel.sigma or again:
                how = "as it does elsewhere" if again else f"to its resolution of {quantum:.3g}"
                text += f"{how}: the machine is at rest there, or the sensor is frozen"
                yield Finding("warning", "frozen", run.name, channel.name, text)
            else:
                text += "though it carries noise: a frozen sensor"
                yield Finding("error", "frozen", run.name, channel.name, text)
        elif not changes.size:
            text = f"is {values[0]:g} {channel.unit} throughout: a constant channel"
            yield Finding("error", "constant", run.name, channel.name, text)


def check_model(simulator: Simulator, theta: Vector | None = None) -> list[Finding]:
    """Problems that show against the model (at nominal values if `theta` is not given).

    Wrong parameters look like a shifted clock, too, so at nominal values that must be more evident.
    """
    problem = simulator.problem
    evident = 100.0 if theta is None else 4.0
    theta = problem.nominal if theta is None else theta
    found: list[Finding] = []
    try:
        problem.system()
        models = dict(
            zip(
                [run.name for run in problem.runs],
                simulator.spread(lambda run: simulator.simulate(theta, run), problem.runs),
                strict=True,
            )
        )
    except CosimError as error:
        return [Finding("error", "simulation", "", "", f"the model does not run: {error}")]
    for index in range(len(problem.channels)):
        found += _check_scale(problem, models, index)
    swaps = list(_check_swaps(problem, models, {f.column for f in found if not f.run}))
    # exchanged columns of two sides have the other sign where the sides move against each other
    pairs = {name for f in swaps for name in f.column.split(" and ")}
    found = [f for f in found if not f.run or f.column not in pairs] + swaps
    found += _check_clocks(problem, models, evident)
    found += _check_inputs(simulator, models, theta)
    return found


def _centred(problem: Problem, models: dict[str, Vector], data: int, model: int,
             run: MeasuredRun) -> tuple[Vector, Vector]:  # fmt: skip
    measured, simulated = run.data[:, data], models[run.name][:, model]
    good = np.isfinite(measured) & np.isfinite(simulated)
    measured, simulated = measured[good], simulated[good]
    if not measured.size:
        return measured, simulated
    return measured - measured.mean(), simulated - simulated.mean()


def _follow(
    problem: Problem, models: dict[str, Vector], index: int
) -> dict[str, tuple[float, float]]:
    """Slope and correlation of a column against its signal, for the runs in which it follows."""
    sigma, found = problem.channels[index].sigma, {}
    for run in problem.runs:
        measured, simulated = _centred(problem, models, index, index, run)
        power, noise = float(simulated @ simulated), float(measured @ measured)
        if not measured.size or noise == 0.0 or np.std(simulated) < 5.0 * sigma:
            continue
        cross = float(measured @ simulated)
        correlation = cross / float(np.sqrt(power * noise))
        if abs(correlation) > FOLLOWS:
            found[run.name] = (cross / power, correlation)
    return found


def _check_scale(problem: Problem, models: dict[str, Vector], index: int) -> Iterator[Finding]:
    channel = problem.channels[index]
    follow = _follow(problem, models, index)
    if not follow:
        return
    turned = [name for name, (slope, _) in follow.items() if slope < 0.0]
    if len(turned) > len(follow) / 2:
        text = f"follows {channel.signal} with the sign turned round"
        yield Finding("error", "sign", "", channel.name, text)
    else:
        for name in turned:
            text = f"follows {channel.signal} with the sign turned round in this run alone"
            yield Finding("error", "sign", name, channel.name, text)
    size = float(np.median([abs(slope) for slope, _ in follow.values()]))
    if not 0.5 < size < 2.0:
        near = min(FACTORS, key=lambda item: abs(np.log(size / FACTORS[item])))
        known = abs(np.log(size / FACTORS[near])) < 0.2
        reason = f"the unit looks wrong: {near}" if known else "unit or scale look wrong"
        text = f"is {size:.4g} times what the model has [{channel.unit}]; {reason}"
        sure = known or not 1.0 / STRANGE < size < STRANGE
        yield Finding("error" if sure else "warning", "unit", "", channel.name, text)


def _check_swaps(problem: Problem, models: dict[str, Vector], named: set[str]) -> Iterator[Finding]:
    for a, first in enumerate(problem.channels):
        for b in range(a + 1, len(problem.channels)):
            second = problem.channels[b]
            if first.unit != second.unit or {first.name, second.name} & named:
                continue
            straight = _misfit(problem, models, a, a) + _misfit(problem, models, b, b)
            crossed = _misfit(problem, models, a, b) + _misfit(problem, models, b, a)
            if crossed < 0.1 * straight or (crossed < straight and _differs(problem, models, a, b)):
                text = (
                    f"each fits the other's signal ({second.signal}, {first.signal}) far better: "
                    "the two columns look swapped"
                )
                yield Finding("error", "swapped", "", f"{first.name} and {second.name}", text)


def _differs(problem: Problem, models: dict[str, Vector], a: int, b: int) -> bool:
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


def _misfit(problem: Problem, models: dict[str, Vector], data: int, model: int) -> float:
    sigma = problem.channels[model].sigma
    total = 0.0
    for run in problem.runs:
        difference = run.data[:, data] - models[run.name][:, model]
        total += float(np.nansum((difference / sigma) ** 2))
    return total


def _check_clocks(problem: Problem, models: dict[str, Vector], evident: float) -> Iterator[Finding]:
    """A run, or one column in all runs, that fits much better when it is shifted in time."""
    lags: dict[tuple[str, int], tuple[int, float]] = {}
    for run in problem.runs:
        reach = min(run.times.size // 8, 200)
        for index in range(len(problem.channels)):
            lags[run.name, index] = _best_lag(
                run.data[:, index], models[run.name][:, index], reach,
                problem.channels[index].sigma,
            )  # fmt: skip
    for run in problem.runs:
        own = [lags[run.name, i] for i in range(len(problem.channels))]
        sure = [lag for lag, gain in own if gain > evident]
        interval = float(np.median(np.diff(run.times)))
        if (
            len(sure) > len(own) / 2
            and abs(np.median(sure)) >= 2
            and np.ptp(sure) <= 2 + 0.2 * abs(np.median(sure))
        ):
            late = float(np.median(sure)) * interval
            text = f"all columns fit better shifted: they are late by {late:.4g} s (clock offset)"
            yield Finding("warning", "clock", run.name, "time", text)
    for index, channel in enumerate(problem.channels):
        sure = [
            lags[run.name, index][0] for run in problem.runs if lags[run.name, index][1] > evident
        ]
        others = [lags[run.name, i][0] for run in problem.runs for i in range(len(problem.channels))
                  if i != index and lags[run.name, i][1] > evident]  # fmt: skip
        apart = not others or abs(np.median(others) - np.median(sure or [0])) >= 2
        if len(sure) > len(problem.runs) / 2 and abs(np.median(sure)) >= 2 and apart:
            interval = float(np.median(np.diff(problem.runs[0].times)))
            text = f"is late by {np.median(sure) * interval:.4g} s against the model (clock offset)"
            yield Finding("warning", "clock", "", channel.name, text)


def _best_lag(measured: Vector, simulated: Vector, reach: int, sigma: float) -> tuple[int, float]:
    """Lag in samples with the least squares, and by what factor it is better than none."""

    def misfit(lag: int) -> float:
        late = measured[reach + lag : measured.size - reach + lag]
        return float(np.nanmean((late - simulated[reach : measured.size - reach]) ** 2))

    if reach < 2 or not np.isfinite(measured).any() or np.std(simulated) < 5.0 * sigma:
        return 0, 1.0
    coarse = min(range(-reach, reach + 1, max(reach // 40, 1)), key=misfit)
    near = range(max(coarse - reach // 40, -reach), min(coarse + reach // 40, reach) + 1)
    best = min(near, key=misfit)
    return best, misfit(0) / (misfit(best) + sigma**2)


def _check_inputs(
    simulator: Simulator, models: dict[str, Vector], theta: Vector
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
