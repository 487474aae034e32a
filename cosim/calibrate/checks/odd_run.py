"""A run that does not fit the others, and what is wrong with its inputs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...data.signals import Signal, Table
from ...errors import CosimError
from ..fit import fit
from ..foretelling import foretold
from ..nuisance import settled
from .each_run import AGAIN, OFF, off_in_unused
from .finding import Finding
from .own_errors import Rest, is_slow
from .scale import FACTORS

if TYPE_CHECKING:
    from ..estimate import Estimate
    from ..simulator import Simulator

Vector = NDArray[np.float64]
SHARE = 0.5
"""Of the excess over the noise's that a run must leave by itself to be asked."""
TRIED, STEPS, NEAR = 0.02, 6, 1e-4
"""By how much a gain of an input is changed first, fits of it at most, and the change that ends
them: a hundredth of what a sensor's gain is known to."""


def check_odd_run(estimate: Estimate) -> Iterator[Finding]:
    """One run that leaves most of what is left, while the others by themselves leave noise.

    Its inputs are tried with the sign turned round, exchanged and scaled; an error if one of these
    leaves noise, for that is no law. Else a warning: another machine, another load, or a law that
    only this run excites. Unused runs are asked where the fitted ones leave noise.
    """
    problem = estimate.problem
    if problem.unstable or not estimate.jacobian:
        return
    left = {name: Rest.of([rows]) for name, rows in estimate.residuals}
    total = Rest.of(rows for _, rows in estimate.residuals)
    if total.excess <= total.chance:
        yield from _unused(estimate)
        return
    odd = max(left, key=lambda name: left[name].excess)
    others = [name for name in left if name != odd]
    if left[odd].mean < OFF or left[odd].excess < SHARE * total.excess or len(others) < 2:
        return  # of two runs none is the odd one
    try:
        again = fit(estimate.simulator, estimate.theta, others, effort=AGAIN)
        theta = settled(estimate.simulator, again.theta, [odd])
        ((_, rows),) = estimate.simulator.residuals(theta, [odd])
        beside = foretold(replace(again, theta=theta), [(odd, rows)])
    except CosimError:  # what cannot be fitted tells nothing
        return
    calm = Rest.of(values for _, values in again.residuals)
    apart = Rest.of([rows])
    if calm.excess > calm.chance or is_slow(again.residuals):
        return
    if apart.mean < OFF or not is_slow(beside):  # no more than intervals make of it
        return
    if (finding := _input(estimate.simulator, theta, odd, apart)) is not None:
        yield finding
        return
    text = (
        f"does not fit the others, which leave noise by themselves: its mean square over the "
        f"noise's is {apart.mean:.3g} then. Another machine, load or floor, a log of its own kind, "
        "or a law that is missing and that only this run excites"
    )
    yield Finding("warning", "differs", odd, "", text)


def _unused(estimate: Estimate) -> Iterator[Finding]:
    """What is wrong with inputs of runs that were not fitted, where the others leave noise."""
    theta, residuals = off_in_unused(estimate)
    for name, rows in residuals:
        left = Rest.of([rows])
        if left.mean >= OFF and (finding := _input(estimate.simulator, theta, name, left)):
            yield finding


def _input(simulator: Simulator, theta: Vector, name: str, before: Rest) -> Finding | None:
    """The finding on an input of a run, if there is one that makes all of it noise."""
    inputs = simulator.problem.run(name).inputs
    tables = {n: s for n, s in inputs.items() if isinstance(s, Table)}

    def tried(changed: Mapping[str, Signal]) -> Vector | None:
        problem = simulator.problem
        runs = [
            replace(r, inputs={**r.inputs, **changed}) if r.name == name else r
            for r in problem.runs
        ]
        trial = simulator.of(problem.changed(runs=runs))
        try:
            ((_, rows),) = trial.residuals(theta, [name])
        except CosimError:  # what cannot be simulated is no explanation
            return None
        finally:
            trial.close()
        return rows

    def noise(rows: Vector | None) -> Rest | None:
        left = None if rows is None else Rest.of([rows])
        good = left is not None and left.excess <= left.chance
        return left if good and rows is not None and not is_slow([(name, rows)]) else None

    def finding(column: str, what: str, after: Rest) -> Finding:
        text = (
            f"{what} in this run alone: with that the mean square over the noise's falls from "
            f"{before.mean:.3g} to {after.mean:.3g}. Mend the log, or leave the run out"
        )
        return Finding("error", "differs", name, column, text)

    for first in tables:
        if left := noise(tried({first: tables[first].scaled(-1.0)})):
            return finding(_column(tables[first]), "has the sign turned round", left)
    for first in tables:
        for second in list(tables)[list(tables).index(first) + 1 :]:
            if left := noise(tried({first: tables[second], second: tables[first]})):
                pair = f"{_column(tables[first])} and {_column(tables[second])}"
                return finding(pair, "are exchanged", left)
    for first in tables:
        for unit, factor in FACTORS.items():
            if left := noise(tried({first: tables[first].scaled(1.0 / factor)})):
                return finding(_column(tables[first]), f"is in another unit ({unit})", left)
    for first in tables:
        factor, rows = _gain(lambda f, n=first: tried({n: tables[n].scaled(f)}))  # type: ignore[misc]
        if left := noise(rows):
            what = f"is {1.0 / factor:.4g} times what drives the machine"
            return finding(_column(tables[first]), what, left)
    return None


def _column(signal: Table) -> str:
    """Of the log that an input comes from."""
    return signal.text.rpartition(":")[2]


def _gain(tried: Callable[[float], Vector | None]) -> tuple[float, Vector | None]:
    """The factor of an input that leaves least, by secants, and what it leaves."""
    before, last, factor = tried(1.0), 1.0, 1.0 + TRIED
    rows = tried(factor)
    for _ in range(STEPS):
        if before is None or rows is None:
            return factor, None
        slope = (rows - before) / (factor - last)
        good = np.isfinite(slope)
        step = -float(slope[good] @ rows[good]) / max(float(slope[good] @ slope[good]), 1e-300)
        if abs(step) < NEAR * abs(factor):
            break
        before, last, factor = rows, factor, factor + step
        rows = tried(factor)
    return factor, rows
