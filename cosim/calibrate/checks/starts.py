"""Runs that begin where the model does not: in motion, or from a value that nobody stated.

What a machine begins with are positions and speeds. Where they are the model's, and the machine
stands as long as the model does, another current or torque is no other beginning: a force that the
model lacks (friction, a detent, a weight) holds it there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...errors import CosimError
from ...spec.units import BASE, parse
from .finding import Finding

if TYPE_CHECKING:
    from ..parts import MeasuredRun
    from ..problem import Problem
    from ..simulator import Simulator

Vector = NDArray[np.float64]
FIRST = 5
"""Samples at the beginning that count together."""
OFF = 10.0
"""Deviations of their mean from which a beginning is another one."""
RESTS = 3.0
"""Deviations of one sample by which means of `FIRST` samples may differ in a machine that stands:
five of their own, so that noise does not do it in any channel of any run."""
LITTLE = 0.02
"""Of a turn, by which a machine that was placed by hand may be off: seven degrees."""
MOVES = 0.25
"""Share of the way to the bounds by which the parameters are changed."""


def check_starts(simulator: Simulator, models: Mapping[str, Vector]) -> Iterator[Finding]:
    """Channels whose first samples are not where the model begins, and not always alike.

    The mean of `FIRST` samples has the deviation sigma / sqrt(`FIRST`), so that `OFF` sigma are 22
    of its deviations: noise does not do it. An offset of a sensor does, but the same in all runs,
    so what all runs have in common does not count; and so does a channel that answers the inputs at
    once, by its parameters, so what changes by a quarter of their bounds does not count either.
    """
    problem = simulator.problem
    stated = {
        run.name for run in problem.runs
        if any(p.run == run.name for p in (*problem.parameters, *problem.late))
    }  # fmt: skip
    off: dict[str, Vector] = {}
    begun: dict[str, Vector] = {}
    for run in problem.runs:
        data, model = run.data[:FIRST], models[run.name][:FIRST]
        begun[run.name] = _known(np.nanmean, np.where(np.isfinite(data), model, np.nan))
        off[run.name] = _known(np.nanmean, data) - begun[run.name]
    middle = _known(np.nanmedian, np.stack(list(off.values())))
    common = np.nan_to_num(middle) if len(off) > 2 else 0.0
    for run in problem.runs:
        far = np.abs(off[run.name] - common)
        wrong = [
            i for i in range(len(problem.channels))
            if np.isfinite(far[i]) and far[i] > OFF * problem.channels[i].sigma
        ]  # fmt: skip
        if run.name in stated or not wrong:
            continue
        moved = _by_parameters(simulator, run.name, models[run.name])
        wrong = [i for i in wrong if far[i] > OFF * (problem.channels[i].sigma + moved[i])]
        if not wrong:
            continue
        # a speed that most runs begin with is no sensor's zero where the angles are not alike
        apart, expected = np.abs(off[run.name]), begun[run.name]
        told = {i for i in range(apart.size) if apart[i] > OFF * problem.sigma[i] + moved[i]}
        told |= set(wrong)
        names = ", ".join(
            f"{problem.channels[i].name} {expected[i] + off[run.name][i]:.4g} instead of "
            f"{expected[i]:.4g} {problem.channels[i].unit}".rstrip()
            for i in sorted(told, key=lambda i: -apart[i] / problem.sigma[i])
        )
        names += f"; means of the first {FIRST} samples"
        if _held(simulator, run, models[run.name], wrong):
            text = (
                f"stands where the model stands, but not with the same effort ({names}): a force "
                "that the model lacks, or a sensor's zero"
            )
            yield Finding("warning", "start", run.name, "", text)
            continue
        if all(_turned(problem, i, off[run.name][i]) for i in wrong):
            text = (
                f"begins a whole turn from where it is said to ({names}): give the start in the "
                "turn in which the column begins"
            )
            yield Finding("error", "start", run.name, "", text)
            continue
        text = (
            f"begins where the model does not ({names}): estimate what the system begins with as "
            'a [[nuisance]] with targets = "VARIABLE" of the start, nominal = "first:COLUMN", a '
            "span of several of the column's deviations and per_run = true; or, of a column "
            'without noise, give it in [starts] ("first:COLUMN" = "VARIABLE"); or begin with a '
            "sample at rest"
        )
        yield Finding("error", "start", run.name, "", text)


def _turned(problem: Problem, index: int, off: float) -> bool:
    """Whether an angle is off by whole turns, but for what begins a little off."""
    channel = problem.channels[index]
    _, (variable, *_) = problem.system().variables(channel.signal)
    unit = parse(channel.unit) if channel.unit else variable.unit
    exponents = dict(zip(BASE, unit.exponents, strict=True)) if unit else {}
    if {k: n for k, n in exponents.items() if n} != {"rad": 1}:
        return False
    turn = 2.0 * np.pi / channel.angle
    rest = off - turn * np.round(off / turn)
    return bool(abs(off) > 0.5 * turn and abs(rest) < LITTLE * turn)


def _held(simulator: Simulator, run: MeasuredRun, model: Vector, wrong: list[int]) -> bool:
    """Whether the machine stands as long as the model does, and only efforts are not its own."""
    problem = simulator.problem
    sigma = problem.sigma
    moved = np.any(np.abs(model - model[0]) > sigma, axis=1)
    stands = int(np.argmax(moved)) if moved.any() else len(model)
    if stands < 2 * FIRST or any(_moves(problem, i) for i in wrong):
        return False
    ends = np.nan_to_num(run.data[stands - FIRST : stands] - run.data[:FIRST])
    # means of so few samples differ by their noise
    return bool(np.all(np.abs(ends.mean(axis=0)) < RESTS * sigma))


def _moves(problem: Problem, channel: int) -> bool:
    """Whether a channel may show a position or a speed: its signal's unit is of no effort."""
    _, (variable, *_) = problem.system().variables(problem.channels[channel].signal)
    if variable.unit is None:
        return True
    exponents = dict(zip(BASE, variable.unit.exponents, strict=True))
    return not (exponents["kg"] or exponents["A"])


def _known(average: Callable[..., Vector], values: Vector) -> Vector:
    """The average of each column's known values, nan where there are none."""
    known = np.isfinite(values).any(axis=0)
    found = np.full(values.shape[1], np.nan)
    found[known] = average(values[:, known], axis=0)
    return found


def _by_parameters(simulator: Simulator, name: str, model: Vector) -> Vector:
    """How far the parameters move the first samples."""
    problem = simulator.problem
    moved = np.zeros(model.shape[1])
    for bound in (problem.lower, problem.upper):
        theta = problem.nominal + MOVES * (bound - problem.nominal)
        try:
            other = simulator.simulate(theta, name)
        except CosimError:  # what cannot be simulated there says nothing
            continue
        moved = np.maximum(moved, np.max(np.abs(other[:FIRST] - model[:FIRST]), axis=0))
    return moved
