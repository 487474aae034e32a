"""Runs that all begin where the model does not, so far that the fit has gone elsewhere.

A machine that is always logged in motion, or from where it hangs, begins at the same value in all
runs. Before a fit that may be the zero of a sensor, and after it parameters have made up for it as
far as they can: no first order around them leads back. So the starts are read off the first samples
and a fit begins there, at nominal values.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...errors import CosimError
from ..fit import Effort, fit
from .each_run import entry_of, moved, told
from .finding import Finding
from .own_errors import (
    LEAVES,
    PLACED,
    WIDE,
    Kind,
    OwnErrors,
    Rest,
    Vector,
    free,
    is_slow,
    starts_of,
)  # fmt: skip
from .starts import FIRST, OFF

if TYPE_CHECKING:
    from ..estimate import Estimate
    from ..problem import Problem

AGAIN = Effort("far", "intervals")
"""Of the fit with the starts: from nominal values."""
REALS = ("Float64", "Float32")
"""Types of what a machine begins with."""
SHOWN = 0.5
"""Share of what a start does to a channel within the first samples that it does to the first one:
a position is shown at once, and a speed is not by a position."""


def check_begun(estimate: Estimate) -> Iterator[Finding]:
    """Starts that explain what a fit leaves, where the first samples of all runs are off.

    A sensor's zero is off at all times: a start that only adds a constant to channels is none of
    this. An error where a fit with the starts leaves noise, or `LEAVES` of what was left.
    """
    problem, simulator = estimate.problem, estimate.simulator
    names = [name for name, _ in estimate.residuals]
    if problem.unstable or not names or not is_slow(estimate.residuals):
        return
    try:
        begun = list(simulator.residuals(problem.nominal, names))
        off = _off(begun) & _off(estimate.residuals)
        if not off.any():
            return
        asked = OwnErrors(simulator, problem.nominal, begun, ())
        asked.ask([*starts_of(problem), *_settable(problem)])
        starts = _read(asked, off)
        if not starts or asked.constant([kind for kind, _, _ in starts]):
            return
        added = [
            free(kind, run, begins, WIDE * abs(value)) for kind, run, value in starts
            for begins in [asked.begins(kind, run)]
        ]  # fmt: skip
        values = [p.nominal + value for p, (_, _, value) in zip(added, starts, strict=True)]
        wider = problem.with_parameters([*problem.parameters, *added])
        again = fit(
            simulator.of(wider), np.concatenate([problem.nominal, values]), names, effort=AGAIN
        )
    except CosimError:  # what cannot be simulated explains nothing
        return
    before = Rest.of(rows for _, rows in estimate.residuals)
    left = Rest.of(rows for _, rows in again.residuals)
    if left.excess > max(left.chance, LEAVES * before.excess):
        return
    kinds = [kind for kind in dict.fromkeys(kind for kind, _, _ in starts) if told(again, kind)]
    if not kinds:
        return
    more = left.excess > left.chance
    text = (
        "all runs begin where the model does not: "
        + "; ".join(told(again, k) for k in kinds)
        + f". With that the mean square over the noise's falls from {before.mean:.3g} to "
        f"{left.mean:.3g}{' (so something else is missing, too)' * more}{moved(estimate, again)}. "
        "Give it in [starts] or [parameters], or estimate it: a [[nuisance]] with "
        + " and one with ".join(entry_of(asked, again, kind) for kind in kinds)
        + f",{' each' * (len(kinds) > 1)} with per_run = true"
    )
    yield Finding("error", "start", "", "", text)


def _settable(problem: Problem) -> Iterator[Kind]:
    """Parameters and exact starts of FMUs that name no derivatives: states are among them."""
    taken = {target for p in problem.parameters for target, _ in p.targets}
    for name, member in problem.plain().members.items():
        variables = member.description.variables
        if any(variable.startswith("der(") for variable in variables):
            continue
        for variable in variables.values():
            full = f"{name}.{variable.name}"
            exact = variable.initial == "exact" and variable.type in REALS
            if exact and variable.causality != "input" and full not in taken:
                symbol = variable.unit.symbol if variable.unit else ""
                for element in variable.elements():
                    yield Kind(f"{name}.{element}", f"{name}.{element}", symbol, PLACED)


def _off(residuals: Sequence[tuple[str, Vector]]) -> NDArray[np.bool_]:
    """Channels that are off at the beginning of all runs, to the same side."""
    means = np.array([_mean(rows) for _, rows in residuals])
    alike = np.all(means > OFF, axis=0) | np.all(means < -OFF, axis=0)
    return np.asarray(alike, dtype=np.bool_)


def _mean(rows: Vector) -> Vector:
    """Mean of the first samples by channel, 0 where nothing was measured."""
    first = rows[:FIRST]
    count = np.isfinite(first).sum(axis=0)
    return np.asarray(np.nansum(first, axis=0) / np.maximum(count, 1))


def _read(asked: OwnErrors, off: NDArray[np.bool_]) -> list[tuple[Kind, str, float]]:
    """Starts that the first samples of channels which are off show, by run: kind, run, how far."""
    found = []
    for run, rows in asked.residuals:
        columns = [(c.kind, asked.by_channel(c)) for c in asked.columns if c.run == run]
        shown = [
            (kind, values[0]) for kind, values in columns
            if np.any(off & (np.abs(values[0]) > SHOWN * np.max(np.abs(values[:FIRST]), axis=0)))
        ]  # fmt: skip
        if not shown:
            return []
        matrix = np.array([first[off] for _, first in shown]).T
        sizes = np.linalg.lstsq(matrix, -_mean(rows)[off], rcond=None)[0]
        found += [(kind, run, float(v)) for (kind, _), v in zip(shown, sizes, strict=True) if v]
    return found
