"""What is in a log: columns, units, clocks, and what is odd."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..calibrate.checks.finding import Finding
from ..calibrate.checks.smooth import ENOUGH, ORDER, roughness
from ..errors import UnknownNameError, listing
from .clock import Clock, find_clock
from .guess import Guess, guess_unit
from .quaternions import with_yaws
from .rules import cells, copies, limits, lost, spiking, still, times, turning
from .sources import open_source
from .topic import Source, Topic

RULES = (times, cells, lost, still, limits, spiking, turning, copies)


@dataclass(frozen=True)
class ColumnReport:
    """A column.

    Attributes:
        name: of it.
        unit: and why.
        count, missing: cells, and those without a number.
        low, high: extreme values, NaN if there are none.
        resolution: smallest difference of two values, 0 if there is none.
        noise: deviation of what is white in it, 0 where it is too short or not measured.
    """

    name: str
    unit: Guess
    count: int
    missing: int
    low: float
    high: float
    resolution: float
    noise: float

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "name": self.name, "unit": self.unit.unit, "reason": self.unit.reason,
            "sure": self.unit.sure, "count": self.count, "missing": self.missing,
            "min": _json(self.low), "max": _json(self.high), "resolution": self.resolution,
            "noise": self.noise,
        }  # fmt: skip


def _json(value: float) -> float | None:
    return value if np.isfinite(value) else None


@dataclass(frozen=True)
class TopicReport:
    """A topic with all that was found about it."""

    topic: Topic
    clock: Clock
    columns: tuple[ColumnReport, ...]
    findings: tuple[Finding, ...]

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "name": self.topic.name, "kind": self.topic.kind, "frames": self.topic.frames,
            "clock": self.clock.to_dict(), "columns": [c.to_dict() for c in self.columns],
            "findings": [f.to_dict() for f in self.findings],
        }  # fmt: skip


@dataclass(frozen=True)
class FileReport:
    """A file with its topics."""

    source: Source
    topics: tuple[TopicReport, ...]

    def column_names(self) -> frozenset[str]:
        """Columns of all topics but their clocks, with the topic where a file has topics."""
        return frozenset(
            column.name if self.source.plain else f"{topic.topic.name}.{column.name}"
            for topic in self.topics
            for column in topic.columns
        )

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "file": str(self.source.path), "kind": self.source.kind,
            "topics": [t.to_dict() for t in self.topics], "left_out": self.source.left,
        }  # fmt: skip


def inspect(
    path: Path | str, topics: Iterable[str] = (), clock: str = "", received: bool = False
) -> FileReport:
    """What is in a file.

    Args:
        path: of the log.
        topics: only these, all if not given.
        received: of a bag, take the times of recording instead of the stamps in headers.
        clock: column of times of the topics that have it; found by itself if not given.

    Raises:
        ScenarioError: it cannot be read.
    """
    source = open_source(Path(path), tuple(topics), received)
    if clock:
        timed = [replace(t, clock=clock) if clock in t.log.columns else t for t in source.topics]
        source = replace(source, topics=tuple(timed))
    return FileReport(source, tuple(inspect_topic(topic) for topic in source.topics))


def check_clock(reports: Iterable[FileReport], clock: str) -> None:
    """Refuse a clock that none of the files has; "" is none that was asked for.

    Raises:
        UnknownNameError: with the columns that there are.
        ScenarioError: it holds text.
    """
    logs = [topic.topic.log for report in reports for topic in report.topics]
    if not clock or any(clock in log.columns for log in logs):
        return
    for log in logs:
        if clock in log.texts:
            log[clock]  # says what it holds
    names = dict.fromkeys(name for log in logs for name in log.columns)
    raise UnknownNameError(f"--clock {clock}: no log has such a column; {listing(names, clock)}")


def inspect_topic(topic: Topic) -> TopicReport:
    """What is in a topic."""
    topic = with_yaws(topic)
    clock = find_clock(topic)
    columns = tuple(
        _column(topic, name) for name in topic.log.columns if name != clock.column
    )  # fmt: skip
    findings = tuple(finding for rule in RULES for finding in rule.check(topic, clock))
    return TopicReport(topic, clock, columns, findings)


def _column(topic: Topic, name: str) -> ColumnReport:
    values = topic.log[name]
    good = values[np.isfinite(values)]
    part = next((yaw for yaw, parts in topic.made.items() if name in parts), "")
    guess = (
        Guess("1", f"of a quaternion, whose yaw is {part}", sure=True) if part
        else Guess("rad", f"of the quaternion {', '.join(topic.made[name])}", sure=True)
        if name in topic.made
        else guess_unit(name, values, topic.log.units.get(name, ""))
    )  # fmt: skip
    distinct = np.unique(good)
    resolution = float(np.min(np.diff(distinct))) if distinct.size > 1 else 0.0
    return ColumnReport(
        name, guess, values.size, values.size - good.size,
        float(good.min()) if good.size else np.nan, float(good.max()) if good.size else np.nan,
        resolution, roughness(good, ORDER) if good.size > ENOUGH else 0.0,
    )  # fmt: skip
