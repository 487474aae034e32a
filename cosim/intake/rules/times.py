"""Clocks that stand still, go back, jump, jitter or miss rows; and topics without one."""

from __future__ import annotations

from collections.abc import Iterator

from ...calibrate.checks.finding import Finding
from ...calibrate.checks.times import UNEVEN
from ..clock import Clock
from ..topic import Topic

JUMP = 3600.0
"""[s] A gap that is longer than this and than the rest of the log is a jump of the clock."""


def check(topic: Topic, clock: Clock) -> Iterator[Finding]:
    """Faults of a clock."""
    name = topic.name
    if not clock.column:
        text = (
            "has no clock: no column rises evenly; name one with --clock, or add a column of times"
        )
        yield Finding("error", "clock", name, "", text)
        return
    if clock.same:
        text = f"has {clock.same} times that are there twice"
        yield Finding("warning", "clock", name, clock.column, text)
    if clock.back:
        text = f"goes back in {clock.back} places"
        yield Finding("error", "clock", name, clock.column, text)
    if not clock.unit.unit:
        text = f"is in a unit that is not known ({clock.unit.reason})"
        yield Finding("warning", "unit", name, clock.column, text)
    if clock.gaps:
        longest = max(clock.gaps, key=lambda gap: gap[1])
        rest = clock.duration - longest[1]
        what = "jumps" if longest[1] > JUMP and longest[1] > rest else "has a gap of"
        how = f"by {longest[1]:.4g} s" if what == "jumps" else f"{longest[1]:.4g} s"
        more = f" (and {len(clock.gaps) - 1} others)" if len(clock.gaps) > 1 else ""
        text = f"{what} {how} after {longest[0]:.6g} s{more}; usual are {clock.interval:.4g} s"
        yield Finding("warning", "gap", name, clock.column, text)
    if clock.jitter > UNEVEN:
        text = (
            f"jitters: intervals of {clock.interval:.4g} s with a deviation of {clock.jitter:.0%}"
        )
        yield Finding("warning", "jitter", name, clock.column, text)
