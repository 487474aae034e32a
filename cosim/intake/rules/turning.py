"""Angles that begin anew at a turn."""

from __future__ import annotations

from collections.abc import Iterator

from ...calibrate.checks.finding import Finding
from ..clock import Clock
from ..guess import is_angle, turn_of, unit_in_name
from ..topic import Topic


def check(topic: Topic, clock: Clock) -> Iterator[Finding]:
    """Columns that jump by a turn (`guess.turn_of`)."""
    for name, values in topic.log.columns.items():
        known = topic.log.units.get(name, "") or unit_in_name(name)
        if name == clock.column or not is_angle(known):
            continue
        unit, turn, count = turn_of(values)
        if unit:
            text = f"begins anew at a turn of {turn:.4g} {unit}, {count} times: unwrap = true"
            yield Finding("note", "wrapped", topic.name, name, text)
