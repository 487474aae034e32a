"""What differs from run to run and is no law: places that runs begin at, faults of their columns.

No first sample shows a heading that is off by a few deviations of its noise, but whole runs do: the
path turns with it, parameters make up for what they can, and intervals know nothing of it. A column
that is late in one run, or has another zero there, leaves an excess that no law takes up.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...errors import CosimError
from ...installation.examples import read_mapping
from ..fit import Effort, fit
from ..foretelling import foretold
from ..named import named
from ..nuisance import settled
from .finding import Finding, quantity
from .own_errors import Kind, OwnErrors, Rest, columns_of, is_slow, starts_of

if TYPE_CHECKING:
    from ..estimate import Estimate
    from ..problem import Problem

Vector = NDArray[np.float64]
OFF = 1.5
"""Mean square over the noise's from which nothing but errors of runs leaves noise: nine starts of
three runs leave a sixth of what unequal wheels do, and less is seen. Below it, a law may do as
well."""
ALSO = 0.1
"""Share of what the worst run is off from which others are said to be, too."""
AGAIN = Effort("near", "intervals", iterations=8)
"""Of a fit with these errors, or without the run that has them: they change residuals nearly as a
straight line does, and have bent the parameters, not turned them round."""


def check_each_run(estimate: Estimate) -> Iterator[Finding]:
    """Errors of single runs that explain all that a fit leaves (`own_errors`).

    First what runs begin with is asked, then one error of one column. A gain that noise does not
    make and that leaves little is tried in a fit. If that leaves noise, white over time, this is
    what is wrong: of a law that the model lacks, errors of runs make up for a part. Where there is
    little to explain (`OFF`), that part may be all that shows, and it is a warning.

    Starts that are off alike in all runs are a frame that is turned, which is mended in the same
    way; where they only add a constant to channels, they may be the zero of a sensor, and are a
    warning. A column whose error is the same in all runs is another matter: an effect.

    Where fitted runs leave noise and unused ones do not, these are asked.
    """
    problem, simulator = estimate.problem, estimate.simulator
    if problem.unstable or not estimate.jacobian:
        return
    asked = OwnErrors(simulator, estimate.theta, estimate.residuals, estimate.jacobian)
    found = _found(estimate, asked)
    if found is None and not is_slow(asked.residuals):
        theta, residuals = off_in_unused(estimate)
        found = _found(estimate, OwnErrors(simulator, theta, residuals, ())) if residuals else None
    if found is not None:
        yield found


def off_in_unused(estimate: Estimate) -> tuple[Vector, list[tuple[str, Vector]]]:
    """Unused runs that are off by more than intervals make of it: parameters, and what is left."""
    simulator = estimate.simulator
    names = [run.name for run in estimate.problem.chosen("validation")]
    if not names:
        return estimate.theta, []
    try:
        theta = settled(simulator, estimate.theta, names)
        residuals = list(simulator.residuals(theta, names))
        beside = dict(foretold(replace(estimate, theta=theta), residuals))
    except CosimError:  # what cannot be simulated there is told elsewhere
        return estimate.theta, []
    return theta, [(name, rows) for name, rows in residuals if is_slow([(name, beside[name])])]


def _found(estimate: Estimate, asked: OwnErrors) -> Finding | None:
    """The finding in the runs that are asked, if there is one."""
    if not is_slow(asked.residuals) or not asked.residuals:
        return None
    worst, starts = asked.worst(), list(starts_of(asked.problem))
    worst.ask(starts)
    if worst.possible(singly=False):
        asked.ask(starts)
        if (finding := _tried(estimate, asked, asked.together())) is not None:
            return finding
    columns = list(columns_of(asked.problem, asked.alone()))
    worst.ask(columns)
    if not worst.possible(singly=True):
        return None
    asked.ask(columns)
    kinds = asked.single()
    # what is the same in all fitted runs is an effect
    if not kinds or (asked.fitted and asked.alike(kinds)):
        return None
    return _tried(estimate, asked, kinds)


def _tried(estimate: Estimate, asked: OwnErrors, kinds: Sequence[Kind]) -> Finding | None:
    """The finding, if a fit with these errors leaves noise."""
    if not kinds:
        return None
    names = [name for name, _ in asked.residuals]
    fitted = [name for name, _ in estimate.residuals]
    try:
        again = fit(*asked.opened(kinds), dict.fromkeys([*fitted, *names]), effort=AGAIN)
    except CosimError:  # what cannot be fitted explains nothing
        return None
    left = [(name, rows) for name, rows in again.residuals if name in names]
    rest = Rest.of(rows for _, rows in left)
    if rest.excess > rest.chance or is_slow(left):
        return None
    kinds = [kind for kind in kinds if told(again, kind)]  # bends look like others to first order
    if not kinds:
        return None
    starts, alike = kinds[0].starts, asked.fitted and asked.alike(kinds)
    zero, little = starts and alike and asked.constant(kinds), asked.rest.mean < OFF
    text = (
        "runs do not begin quite where they are said to: " if starts
        else "a column is another one from run to run: "
    ) + "; ".join(told(again, kind) for kind in kinds)  # fmt: skip
    text += (
        f". With that the mean square over the noise's falls from {asked.rest.mean:.3g} to "
        f"{rest.mean:.3g}{moved(estimate, again)}. "
        + ("Estimate it: " if starts else "Mend the log, or estimate it: ")
        + "a [[nuisance]] with "
        + " and one with ".join(entry_of(asked, again, kind) for kind in kinds)
        + f",{' each' * (len(kinds) > 1)} with per_run = true"
    )
    if zero:
        text += "; or it is the zero of a sensor, as all runs are off alike"
    elif starts:
        text += "; or their frame is turned or moved, as all runs are off alike" * (
            alike and len(names) > 1
        )
    text += "; or a law is missing that does as much" * (little and not zero)
    severity = "warning" if zero or little else "error"
    return Finding(severity, "start" if starts else "differs", "", "", text)


def moved(estimate: Estimate, again: Estimate) -> str:
    """Which declared parameters leave their intervals."""
    moved = [
        f"{p.name} from {quantity(before, '')} to {quantity(again.values[p.name], p.unit)}"
        for p, before, low, high in zip(
            estimate.problem.parameters, estimate.theta.tolist(), estimate.low.tolist(),
            estimate.high.tolist(), strict=True,
        )
        if p.role == "declared" and not low <= again.values[p.name] <= high
    ]  # fmt: skip
    return f", and it moves {', '.join(moved)}, out of the intervals" if moved else ""


def told(again: Estimate, kind: Kind) -> str:
    """The run that is farthest off, and how many others are off, too."""
    found = [
        (abs(value - p.nominal), quantity(value, p.unit.removeprefix("1")), low, high, p)
        for p, value, low, high in zip(
            again.problem.parameters, again.theta.tolist(), again.low.tolist(),
            again.high.tolist(), strict=True,
        )
        if p.targets == ((kind.target, 1.0),) and p.run and not low <= p.nominal <= high
    ]  # fmt: skip
    if not found:
        return ""
    most, value, low, high, p = max(found, key=lambda item: item[0])
    more = sum(size > ALSO * most for size, *_ in found) - 1
    others = f", and less so in {more} more" if more else " alone"
    return (
        f"{kind.what} {value} [{low:.4g}, {high:.4g}] instead of {p.nominal:.4g} in {p.run}{others}"
    )


def entry_of(asked: OwnErrors, again: Estimate, kind: Kind) -> str:
    """What a nuisance for it says."""
    off = [
        max(abs(value - p.nominal), deviation)
        for p, value, deviation in zip(
            again.problem.parameters, again.theta.tolist(), again.deviation.tolist(), strict=True
        )
        if p.targets == ((kind.target, 1.0),) and p.run
    ]
    values = {asked.begins(kind, run) for run, _ in asked.residuals}
    nominal = f"{next(iter(values)):.4g}"
    if len(values) > 1:  # runs say each where they begin, by an entry or a first value
        nominal = f'"{said_of(asked.problem, kind.target)}"'
    return f'targets = "{kind.target}", nominal = {nominal}, span = {4.0 * max(off):.1g}'


def said_of(problem: Problem, target: str) -> str:
    """The key in [starts] of what begins otherwise in each run."""
    table = read_mapping(problem.source.path)
    for key, entry in table.get("starts", {}).items():
        if any(name == target for name, _ in named(entry, f"[starts] {key}")):
            return str(key)
    return "ENTRY of the run, or first:COLUMN"
