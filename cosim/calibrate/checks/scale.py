"""Columns in another unit, or with the sign turned round, against the model at nominal values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..parts import MeasuredRun
from .finding import Finding

if TYPE_CHECKING:
    from ..problem import Problem

Vector = NDArray[np.float64]
FOLLOWS = 0.9
"""Correlation from which a column counts as following a signal."""
MOVES = 5.0
"""Deviations of the noise by which a signal must move to be compared."""
STRANGE = 8.0
"""A column that is so many times too large is no measurement of the signal. By less, it may be
what the model lacks, unless the factor is one of those below: cold grease triples a current."""
BEYOND = 300.0
"""A column that changes by so many times what its signal does is in another unit even where it does
not follow: what a model lacks may double a current or triple it, and by thousandths it is 1000."""
LONG = 1e3
"""Communication steps between samples from which the clock may count thousandths of a second."""
FORETOLD = 0.2
"""Share of a column's power by which the model may miss it and still foretell its sign."""
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
    "rpm instead of degrees per second": 1.0 / 6.0,
    "degrees per second instead of rpm": 6.0,
}
ALIKE = 0.1
"""Logarithm of their ratio below which two factors are told by no slope: half of what a model may
be off by where a factor counts as one of a unit at all."""


def _centred(models: Mapping[str, Vector], data: int, model: int,
             run: MeasuredRun) -> tuple[Vector, Vector]:  # fmt: skip
    measured, simulated = run.data[:, data], models[run.name][:, model]
    good = np.isfinite(measured) & np.isfinite(simulated)
    measured, simulated = measured[good], simulated[good]
    if not measured.size:
        return measured, simulated
    return measured - measured.mean(), simulated - simulated.mean()


def _follow(
    problem: Problem, models: Mapping[str, Vector], index: int
) -> dict[str, tuple[float, float]]:
    """Slope and correlation of a column against its signal, for the runs in which it follows."""
    sigma, found = problem.channels[index].sigma, {}
    for run in problem.runs:
        measured, simulated = _centred(models, index, index, run)
        power, noise = float(simulated @ simulated), float(measured @ measured)
        if not measured.size or noise == 0.0 or np.std(simulated) < MOVES * sigma:
            continue
        cross = float(measured @ simulated)
        correlation = cross / float(np.sqrt(power * noise))
        if abs(correlation) > FOLLOWS:
            found[run.name] = (cross / power, correlation)
    return found


def _foretold(
    problem: Problem, models: Mapping[str, Vector], index: int, name: str, factor: float = -1.0
) -> bool:
    """Whether the model foretells this column elsewhere, and this run's other columns.

    A model that lacks something may turn the other way in one run: a base that pivots about another
    wheel comes back on another side, and a pose in world axes follows the model mirrored. Only what
    the model gets right everywhere else (to `FORETOLD` of its power, in the median) can be said to
    be turned round here by the log and not by the machine, or to be so many times as large; and
    turned back it must be as right.
    """

    def off(run: MeasuredRun, column: int, side: float = 1.0) -> float:
        measured, simulated = _centred(models, column, column, run)
        power = float(measured @ measured)
        return float(np.sum((measured - side * simulated) ** 2)) / power if power > 0.0 else 0.0

    if off(problem.run(name), index, factor) >= FORETOLD:
        return False
    here = [off(run, index) for run in problem.runs if run.name != name]
    others = [off(problem.run(name), i) for i in range(len(problem.channels)) if i != index]
    return all(not found or float(np.median(found)) < FORETOLD for found in (here, others))


def _unit(size: float) -> str:
    """What is wrong with the unit of a column that is so many times its signal, "" if unknown."""
    near = min(FACTORS, key=lambda item: abs(np.log(size / FACTORS[item])))
    return near if abs(np.log(size / FACTORS[near])) < 0.2 else ""


def _wrong(near: str) -> str:
    """What may be wrong with a unit: factors that differ by less than models do are listed."""
    close = [name for name, factor in FACTORS.items()
             if abs(np.log(factor / FACTORS[near])) < ALIKE]  # fmt: skip
    return ", or ".join([near, *(name for name in close if name != near)])


def _spread(problem: Problem, models: Mapping[str, Vector], index: int) -> float:
    """By how many times what its signal does a column changes, in the median over the runs."""
    sizes = []
    for run in problem.runs:
        measured, simulated = _centred(models, index, index, run)
        if measured.size and np.std(simulated) >= MOVES * problem.channels[index].sigma:
            sizes.append(float(np.std(measured) / np.std(simulated)))
    return float(np.median(sizes)) if sizes else 0.0


def _size(follow: Mapping[str, tuple[float, float]]) -> float:
    """How many times its signal a column is, in the median over the runs."""
    return float(np.median([abs(slope) for slope, _ in follow.values()]))


def _all_alike(problem: Problem, models: Mapping[str, Vector], size: float) -> bool:
    """Whether all columns (two or more) are about as many times their signals."""
    others = [_follow(problem, models, index) for index in range(len(problem.channels))]
    sizes = [_size(follow) for follow in others if follow]
    return len(sizes) > 1 and all(abs(np.log(one / size)) < 0.2 for one in sizes)


def _one_run(
    problem: Problem,
    models: Mapping[str, Vector],
    index: int,
    follow: Mapping[str, tuple[float, float]],
) -> Iterator[Finding]:
    """Runs in which a column is in another unit than in the others, where it has the model's size.

    A factor of a unit, to 20 %, in one run alone is what the model lacks by chance only: it must
    foretell all else, and this column with the factor, see `_foretold`.
    """
    channel = problem.channels[index]
    for name, (slope, _) in follow.items():
        others = {other: found for other, found in follow.items() if other != name}
        near = _unit(abs(slope))
        if not near or not others or not 0.5 < _size(others) < 2.0:
            continue
        factor = float(np.copysign(FACTORS[near], slope))
        if _foretold(problem, models, index, name, factor):
            text = (
                f"is {abs(slope):.4g} times what the model has in this run, and "
                f"{_size(others):.4g} times in the others; the unit looks wrong here: "
                f"{_wrong(near)}"
            )
            yield Finding("error", "unit", name, channel.name, text)


def check_scale(problem: Problem, models: Mapping[str, Vector], index: int) -> Iterator[Finding]:
    """Sign and size of a column in the runs in which it follows its signal.

    With a correlation beyond `FOLLOWS` over hundreds of samples, sign and slope are not of chance;
    what else turns or scales a column is the model's lack, which `_foretold` and `STRANGE` leave
    room for. Where runs differ, those are named whose unit is another one.
    """
    channel = problem.channels[index]
    follow = _follow(problem, models, index)
    if not follow:
        if (size := _spread(problem, models, index)) > BEYOND:
            unit = f" [{channel.unit}]" if channel.unit else ""
            text = f"changes by {size:.3g} times what it does in the model{unit}: another unit?"
            yield Finding("error", "unit", "", channel.name, text)
        return
    turned = [name for name, (slope, _) in follow.items() if slope < 0.0]
    if len(turned) > len(follow) / 2 and len(follow) >= len(problem.runs) / 2:
        text = f"follows {channel.signal} with the sign turned round"
        yield Finding("error", "sign", "", channel.name, text)
    else:
        for name in turned:
            if _foretold(problem, models, index, name):
                text = f"follows {channel.signal} with the sign turned round in this run alone"
                yield Finding("error", "sign", name, channel.name, text)
    alone = list(_one_run(problem, models, index, follow))
    yield from alone
    size = _size(follow)
    if not alone and not 0.5 < size < 2.0:
        near = _unit(size)
        reason = f"the unit looks wrong: {_wrong(near)}" if near else "unit or scale look wrong"
        unit = f" [{channel.unit}]" if channel.unit else ""
        text = f"is {size:.4g} times what the model has{unit}; {reason}"
        if _all_alike(problem, models, size):
            text += ". All columns are, so look at the units of the inputs and of the clock first"
        apart = min((run.interval for run in problem.runs if run.times.size > 1), default=0.0)
        if (steps := apart / problem.step) >= LONG:
            text += (
                f". Samples are {steps:.6g} communication steps apart: if the clock counts "
                "thousandths of a second, that is the reason"
            )
        sure = bool(near) or not 1.0 / STRANGE < size < STRANGE
        yield Finding("error" if sure else "warning", "unit", "", channel.name, text)
