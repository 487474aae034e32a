"""Whether what a scenario checks and compares can be measured, asked before it runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..data.comparison import Reference, common_unit
from ..errors import ScenarioError, UnitError, UnknownNameError
from ..scenario.scenario import Scenario
from ..system.system import System

DENSER = 1.5
"""Ratio of intervals that are not meant to be the same; clocks of logs are off by less."""


def measurable(scenario: Scenario, system: System, every: int) -> list[str]:
    """Refuse what cannot be measured; notes on what is measured coarsely.

    Args:
        scenario: whose checks, comparisons and plots are looked at.
        system: that runs.
        every: every n-th communication point is recorded.

    Raises:
        ScenarioError: a check or a comparison is of a vector.
        UnitError: a path is of signals with several units.
    """
    for check in scenario.checks:
        units = [_unit(system, name, f"check {check.name!r}") for name in check.needs]
        if len(check.signals) == 2:
            _one_unit(f"check {check.name!r}", check.signals, units)
    for name, reference in scenario.references.items():
        units = [_unit(system, signal, f"comparison {name!r}") for signal in reference.signals]
        _one_unit(f"comparison {name!r}", reference.signals, units)
    for axes in (*scenario.plots, *(a for figure in scenario.figures for a in figure.plots)):
        for pair in axes.paths:
            what = f"plot {axes.label!r}"
            _one_unit(what, pair, [_unit(system, name, what) for name in pair])
    return _coarse(scenario.references, scenario.step, every)


def _unit(system: System, name: str, what: str) -> str:
    """The unit of one number over time, as far as there is one."""
    try:
        elements = system.elements(name)
    except UnknownNameError:
        return ""  # a swapped variant; others have been refused
    if not elements or (not name.endswith("]") and elements[0].endswith("]")):
        way = f", as in {elements[0]}" if elements else ""
        raise ScenarioError(
            f"{what}: {name} is a vector of {len(elements)} elements, which have no such measure "
            f"together; take one of them{way}"
        )
    return system.unit(elements[0])


def _one_unit(what: str, signals: Sequence[str], units: Sequence[str]) -> None:
    try:
        known = {name: unit for name, unit in zip(signals, units, strict=True) if unit}
        common_unit(known, list(known))
    except UnitError as error:
        raise UnitError(f"{what}: {error}") from None


def _coarse(references: Mapping[str, Reference], step: float, every: int) -> list[str]:
    """A note where references have values between recorded points that the run went through."""
    usual = {}
    for name, reference in references.items():
        apart = np.diff(reference.times)
        usual[name] = float(np.median(apart[apart > 0.0])) if np.any(apart > 0.0) else np.inf
    coarse = [name for name, apart in usual.items() if every * step > DENSER * apart]
    if every == 1 or not coarse:
        return []
    return [
        f"recorded every {every * step:g} s, and compared every "
        f"{min(usual[name] for name in coarse):.3g} s ({', '.join(coarse)}): straight lines stand "
        "for the run between, and their errors count as its own; give a shorter record period "
        "(--record-period, record_period, or period under [record])"
    ]
