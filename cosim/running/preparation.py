"""From a scenario with swapped variants to its system and to what is recorded."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..arguments import need_texts
from ..data.comparison import within
from ..errors import ScenarioError, UnknownNameError, ValueRangeError
from ..files import overlay
from ..scenario.axes import Axes
from ..scenario.scenario import Scenario
from ..system.provider import Provider, get_ready
from ..system.system import System


def recording_interval(scenario: Scenario) -> int:
    """Every how many communication steps are recorded."""
    if scenario.period is None or not 0.0 < scenario.step < scenario.period:
        return 1  # a step that is not positive is refused by the master
    every = round(scenario.period / scenario.step)
    if abs(every * scenario.step - scenario.period) > 1e-6 * scenario.step:
        raise ValueRangeError(
            f"{scenario.name}: record period {scenario.period:g} s is not a whole number of steps "
            f"of {scenario.step:g} s; record every {every * scenario.step:g} s, say "
            "(--record-period, record_period, or period under [record])"
        )
    return every


def swapped_system(
    scenario: Scenario,
    provider: Provider | None,
    instances: Mapping[str, str],
    changed: set[str],
    parameters: Mapping[str, Any],
) -> tuple[System, list[str]]:
    """The system with its values, and notes on what a changed variant does not have."""
    notes = []
    get_ready(provider, instances.values())
    system = replace(scenario.system, instances=dict(instances), parameters={}).build(provider)
    for name, value in overlay(scenario.system.parameters, scenario.parameters).items():
        instance = name.partition(".")[0]
        try:
            system.set(name, value)
        except UnknownNameError:
            if instance not in changed:
                raise
            notes.append(f"{name} of the scenario is left out: {instances[instance]} has none")
    for name, value in parameters.items():
        system.set(name, value)
    return system, notes


def left_out(system: System, changed: set[str]) -> list[str]:
    """Notes on what changed variants are without."""
    return [
        f"{name} is without the {item['what']} ({item['amount']:.4g} {item['unit']}): "
        f"{system.members[name].reference} leaves it out, and nothing else carries it"
        for name in system.members
        if name in changed
        for item in system.members[name].description.extra.get("left_out", ())
    ]


def recorded_signals(
    scenario: Scenario, system: System, changed: set[str]
) -> tuple[tuple[str, ...], list[str]]:
    """Signals to record, and notes on what is not: a changed variant has none, or the end."""
    needed = [name for item in scenario.references.values() for name in item.signals]
    drawn = [*scenario.plots, *(axes for figure in scenario.figures for axes in figure.plots)]
    shown = [*(scenario.plot or ()), *(name for axes in drawn for name in axes.needs)]
    everything = system.signals() if scenario.record is None else scenario.record
    notes = []

    def has(name: str) -> bool:
        instance = name.partition(".")[0]
        try:
            system.variables(name)
        except UnknownNameError:
            if instance not in changed:
                raise
            reference = system.members[instance].reference
            notes.append(f"{name} is not recorded: {reference} has none")
            return False
        return True

    kept = list(filter(has, (*everything, *scenario.also, *shown)))
    checked = filter(has, (name for check in scenario.checks for name in check.needs))
    _need_numbers(scenario, system, drawn)
    every = recording_interval(scenario)
    if beyond := round(scenario.duration / scenario.step) % every if scenario.step > 0.0 else 0:
        last = scenario.start + scenario.duration - beyond * scenario.step
        notes.append(
            f"the last recorded point is at {last:.9g} s: {scenario.duration:.9g} s is not a whole "
            f"number of record periods of {every * scenario.step:.9g} s"
        )
    return tuple(dict.fromkeys([*kept, *needed, *checked])), list(dict.fromkeys(notes))


def _need_numbers(scenario: Scenario, system: System, drawn: list[Axes]) -> None:
    """Refuse texts where numbers are measured, compared or drawn.

    Raises:
        ScenarioError: with what takes which signal.
    """
    uses = [
        *((f"check {check.name!r}", check.needs) for check in scenario.checks),
        *((f"compare {name}", item.signals) for name, item in scenario.references.items()),
        *((f"plot {axes.label!r}", axes.needs) for axes in drawn),
    ]
    for what, signals in uses:
        for signal in signals:
            try:
                type_ = system.variables(signal)[1][0].type
            except UnknownNameError:
                continue  # a changed variant has none
            if type_ in ("String", "Binary"):
                raise ScenarioError(
                    f"{scenario.name}: {what} takes {signal}, which is of type {type_} and no "
                    "number; take another signal"
                )


def shortened(scenario: Scenario, duration: float) -> Scenario:
    """A shorter run keeps the checks whose time window it reaches; others need the whole run."""
    end = np.array([scenario.start + duration])
    kept = tuple(check for check in scenario.checks if within(end, check.before, np.inf).all())
    return replace(scenario, duration=duration, checks=kept)


def adjusted(
    item: Scenario,
    algorithm: str | None = None,
    options: Mapping[str, Any] | None = None,
    step: float | None = None,
    duration: float | None = None,
    record: Sequence[str] = (),
    record_period: float | None = None,
) -> Scenario:
    """A scenario with another algorithm, step, duration or record period where these are given.

    Signals of `record` are recorded, too. Raises InputError where these are no names.

    Options of the scenario hold for its own algorithm only; a shorter run drops the checks that it
    does not reach.
    """
    if record_period is not None and not math.isfinite(record_period):
        raise ValueRangeError(f"{item.name}: record period {record_period:g} s: must be finite")
    need_texts("signals to record", record, 'record=["motor.i"]')
    if duration is not None and duration < item.duration:
        item = shortened(item, duration)
    used = step if step is not None else item.step
    if record_period is not None and record_period < used:
        raise ValueRangeError(
            f"{item.name}: the record period {record_period:g} s is shorter than a step of "
            f"{used:g} s; record every {used:g} s, or take a shorter step"
        )
    return replace(
        item,
        algorithm=algorithm or item.algorithm,
        options={
            **(item.options if algorithm in (None, item.algorithm) else {}),
            **(options or {}),
        },
        step=used,
        duration=duration if duration is not None else item.duration,
        also=(*item.also, *record),
        period=record_period if record_period is not None else item.period,
    )
