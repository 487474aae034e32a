"""All checks in their order: what is wrong with a data set, before and after a fit."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...errors import CosimError
from .averaged import check_averaged
from .begun import check_begun
from .clipped import check_clipped
from .copies import check_columns, check_copies, check_repeated
from .each_run import check_each_run
from .finding import Finding, passed, quantity
from .first_values import check_first_values
from .gaps import check_gaps
from .jumps import check_jumps
from .lags import check_lags
from .late import check_late
from .odd_run import check_odd_run
from .prior import check_priors
from .scale import check_scale
from .smooth import check_smooth, check_stated
from .spiking import check_commands, check_spikes
from .starts import check_starts
from .still import check_still
from .swaps import check_channels, check_inputs, check_runs
from .times import check_times
from .wraps import check_wraps

if TYPE_CHECKING:
    from ..estimate import Estimate
    from ..problem import Problem
    from ..simulator import Simulator

Vector = NDArray[np.float64]
OF_ANOTHER = {"smoothed", "held"}
"""Errors that another column under this name brings, which the model tells."""


def examine(simulator: Simulator) -> list[Finding]:
    """All problems of a data set; against the model only where the logs themselves are in order.

    Errors that the mapping allows are warnings.
    """
    problem = simulator.problem
    allow = problem.source.allow
    findings = passed(check_data(problem), allow)
    if {f.kind for f in findings if f.severity == "error"} <= OF_ANOTHER:
        against = passed(check_model(simulator), allow)
        other = {
            name for f in against if f.severity == "error" and f.kind in ("swapped", "unit")
            for name in f.column.split(" and ")
        }  # fmt: skip
        findings = [f for f in findings if f.kind not in OF_ANOTHER or f.column not in other]
        findings += against
    return findings


def check_data(problem: Problem) -> list[Finding]:
    """Problems of the logs alone."""
    found = list(problem.source.findings)
    if not problem.chosen("identification"):
        text = (
            "no run is for identification: give those that are to be fitted purpose = "
            '"identification" in [[run]] or in set.toml'
        )
        found.append(Finding("error", "purpose", "", "", text))
    for check in (
        check_times, check_still, check_gaps, check_copies, check_columns, check_repeated,
        check_smooth, check_commands,
    ):  # fmt: skip
        found += check(problem)
    return found


def check_fit(estimate: Estimate) -> list[Finding]:
    """Problems that show in what a fit leaves; errors that the mapping allows are warnings."""
    found = list(check_averaged(estimate))
    means = {f.column for f in found}
    found += [f for f in check_stated(estimate) if f.column not in means]
    found += [*check_late(estimate), *check_priors(estimate)]
    for check in (check_each_run, check_begun, check_odd_run):
        if not any(f.severity == "error" for f in found):
            found += check(estimate)
    return passed(found, estimate.problem.source.allow)


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
        return [Finding("error", "simulation", "", "", _stopped(problem, error))]
    found += check_spikes(problem, models)
    turns = list(check_wraps(problem, models))
    found += turns
    known = {(f.run, f.column) for f in turns}
    found += [f for f in check_jumps(problem, models) if (f.run, f.column) not in known]
    found += check_clipped(problem, models)
    for index in range(len(problem.channels)):
        found += check_scale(problem, models, index)
    swaps = list(check_channels(problem, models, {f.column for f in found if not f.run}))
    # exchanged columns of two sides have the other sign where the sides move against each other
    pairs = {name for f in swaps for name in f.column.split(" and ")}
    found = [f for f in found if f.run or f.column not in pairs] + swaps
    if not found:
        found += check_runs(problem, models)
    found += check_lags(problem, models, evident)
    found += check_inputs(simulator, models, theta)
    if not any(f.severity == "error" for f in found):
        found += check_starts(simulator, models)
        found += check_first_values(simulator, theta, models)
    return found


def _stopped(problem: Problem, error: CosimError) -> str:
    """Why the model does not run, with the parameters of the mapping whose variables it names."""
    named = [
        f"{p.name} ({quantity(p.nominal, p.unit)})"
        for p in (*problem.parameters, *problem.late)
        if any(re.search(rf"{re.escape(target)}(?![\w.\[])", str(error)) for target, _ in p.targets)
    ]
    by = f" with parameter {', '.join(named)} of {problem.source.path}" if named else ""
    return f"the model does not run{by}: {error}"
