"""What monitoring found, as a typed object, as JSON, and in a notebook."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from ..display.html import unit as shown_unit
from .change import Change, Found
from .patterns import Direction, Patterns
from .series import Series

Vector = NDArray[np.float64]
VERDICTS = {
    "nothing_changed": "Nothing has changed",
    "changed": "Something has changed",
    "unexplained": "Something has changed, and no name fits",
}


@dataclass(frozen=True)
class Chart:
    """One quantity by log.

    Attributes:
        name, unit, text: of it.
        values, deviations: by log; NaN where it was not seen.
        centre: mean of the first logs.
        low, high: control limits.
        outside: indices of logs beyond them.
    """

    name: str
    unit: str
    text: str
    values: Vector
    deviations: Vector
    centre: float
    low: float
    high: float
    outside: tuple[int, ...]

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "unit": self.unit, "values": _numbers(self.values),
            "deviations": _numbers(self.deviations), "centre": _number(self.centre),
            "limits": [_number(self.low), _number(self.high)], "outside": list(self.outside),
        }  # fmt: skip


@dataclass(frozen=True)
class Monitored:
    """What a series of logs says.

    Attributes:
        series: the logs.
        patterns: what everything would do.
        found: changes and what they rest on.
        baseline: number of first logs that limits are taken from.
        rate: stated probability of any alarm if nothing changes.
        warnings: about data and assumptions.
        wall: time that it took [s].
    """

    series: Series
    patterns: Patterns
    found: Found
    baseline: int
    rate: float
    warnings: list[str]
    wall: float

    @property
    def span(self) -> str:
        """How many logs, from when to when, and how many were no use."""
        logs, left_out = self.series.logs, self.series.left_out
        beside = f" ({left_out} more cannot be used)" if left_out else ""
        return f"{len(logs)} logs from {self.dated(0)} to {self.dated(len(logs) - 1)}{beside}"

    @property
    def changes(self) -> list[Change]:
        """By date."""
        return self.found.changes

    @property
    def verdict(self) -> str:
        """One of `VERDICTS`."""
        if not self.changes:
            return "nothing_changed"
        if any(c.direction is None or not c.fits for c in self.changes):
            return "unexplained"
        return "changed"

    def dated(self, index: int) -> str:
        """Date of a log, with its time if it has one."""
        when = self.series.logs[index].date
        plain = all(log.date.hour == log.date.minute == 0 for log in self.series.logs)
        return f"{when:%Y-%m-%d}" if plain else f"{when:%Y-%m-%dT%H:%M}"

    # -- charts ------------------------------------------------------------------------------------

    def charts(self) -> list[Chart]:
        """Declared parameters, effects that changed, and what is left of each channel."""
        return [*self.parameter_charts(), *self.effect_charts(), *self.channel_charts()]

    def parameter_charts(self) -> list[Chart]:
        """Of declared parameters."""
        theta = self.patterns.theta
        return [
            self._chart(d, float(theta[self.patterns.problem.index(d.name)]))
            for d in self.patterns.directions[: self.patterns.declared]
        ]

    def effect_charts(self) -> list[Chart]:
        """Of effects that were named, against the first logs."""
        named = {
            c.direction.name: c.direction
            for c in self.changes if c.direction is not None and not c.direction.declared
        }  # fmt: skip
        return [self._chart(d, 0.0) for d in named.values()]

    def _chart(self, direction: Direction, origin: float) -> Chart:
        values, deviations = self.found.own
        column = direction.value
        return self._limited(
            direction.name, direction.unit, direction.text,
            origin + direction.scale * values[:, column], direction.scale * deviations[:, column],
            [c for c in self.changes if c.direction and c.direction.name == direction.name],
        )  # fmt: skip

    def channel_charts(self) -> list[Chart]:
        """RMS of what is left over the noise, by channel."""
        return [
            self._limited(
                f"left of {channel.name}", "1",
                "what the model with each log's own parameters leaves, over the noise",
                np.sqrt(self.found.left[:, place]), np.zeros(len(self.series.logs)), self.changes,
            )
            for place, channel in enumerate(self.series.problem.channels)
        ]  # fmt: skip

    def _limited(
        self, name: str, unit: str, text: str, values: Vector, deviations: Vector,
        changes: Sequence[Change],
    ) -> Chart:  # fmt: skip
        """With limits that all points of all charts together exceed at the stated rate.

        They come from those of the first logs in which none of the changes is.
        """
        known = np.isfinite(values)
        alike = np.all([known, *(c.profile.values == 0.0 for c in changes)], axis=0)
        calm = np.flatnonzero(alike[: self.baseline])
        first = values[calm if calm.size > 1 else np.flatnonzero(known[: self.baseline])]
        if first.size < 2:
            return Chart(name, unit, text, values, deviations, math.nan, math.nan, math.nan, ())
        centre, spread = float(first.mean()), float(first.std(ddof=1))
        charts = self.patterns.declared + len(self.series.problem.channels)
        points = max(charts * (len(self.series.logs) - self.baseline), 1)
        factor = float(-stdtrit(first.size - 1, 0.5 * self.rate / points))
        half = factor * spread * math.sqrt(1.0 + 1.0 / first.size)
        low, high = centre - half, centre + half
        outside = tuple(
            int(k) for k in np.flatnonzero((values < low) | (values > high)) if k >= self.baseline
        )
        return Chart(name, unit, text, values, deviations, centre, low, high, outside)

    # -- as a table --------------------------------------------------------------------------------

    def entry(self, change: Change) -> dict[str, Any]:
        """A change for JSON."""
        first, direction = change.profile.first, change.direction
        shared = {
            "kind": change.profile.kind,
            "first_log": self.series.logs[first].name,
            "since": self.dated(first),
            "last_before": self.dated(first - 1) if first else None,
            "until": None if change.profile.last is None else self.dated(change.profile.last),
            "between": [self.dated(max(change.low - 1, 0)), self.dated(change.high)],
            "p": change.p,
            "gain_nats": change.gain,
        }  # fmt: skip
        if direction is None:
            return {
                "what": "unexplained", "place": change.channel, "quantity": "rms of what is left",
                "unit": "1", "factor": math.exp(0.5 * change.amounts[0] * change.full),
                "text": "what is left of the channel is other than before", "named": False,
                "cannot_tell_from": [], **shared,
            }  # fmt: skip
        if change.size is not None:
            size, half = direction.scale * change.size, direction.scale * change.half
        else:  # a phase that is not known, or what calibration absorbs
            norm = float(np.linalg.norm(change.amounts))
            size = direction.scale * change.full * math.copysign(norm, change.amounts[0])
            half = 1.96 * direction.scale * change.full * float(np.max(change.deviations))
        found: dict[str, Any] = {
            "what": direction.name, "place": direction.place, "quantity": direction.quantity,
            "unit": direction.unit, "text": direction.text, "source": direction.kind,
            "named": change.fits, "change": size, "ci95": [size - half, size + half],
            "per_day": size / change.full if change.profile.kind == "creep" else None,
            "cannot_tell_from": list(change.rivals), "same": list(direction.same), **shared,
        }  # fmt: skip
        if direction.declared:
            chart = next(c for c in self.parameter_charts() if c.name == direction.name)
            found["before"] = chart.centre
        return found

    def sentence(self, change: Change) -> str:
        """A change in words."""
        entry = self.entry(change)
        unit = f" {shown_unit(entry['unit'])}".rstrip()
        when = f"since {entry['since']}"
        if entry["last_before"]:
            when += f" (95 %: between {entry['between'][0]} and {entry['between'][1]})"
        if entry["until"]:
            when += f", as before again from {entry['until']}"
        if change.profile.kind == "outlier":
            when = f"in the log of {entry['since']} only"
        if change.direction is None:
            more = f"{entry['factor']:.2f} times as much is left of {change.channel}"
            return f"unexplained: {more} {when}"
        low, high = entry["ci95"]
        size = f"{entry['change']:+.4g}{unit} [{low:+.4g}, {high:+.4g}]"
        name = entry["what"]
        if change.direction.kind == "effect":
            name += f" ({entry['quantity']})"
        verb = {"step": "jumps by", "creep": "creeps by"}
        text = f"{name} {verb.get(change.profile.kind, 'differs by')} {size} {when}"
        if change.profile.kind == "creep":
            text += f", {30.0 * entry['per_day']:+.3g}{unit} in 30 days"
        if not change.fits:
            text = f"unexplained {when}; nearest: {text}, which leaves too much"
        if change.rivals:
            text += f"; cannot be told from {', '.join(change.rivals[:4])}"
            if len(change.rivals) > 4:
                text += f" and {len(change.rivals) - 4} more"
        return text

    def _repr_html_(self) -> str:
        from ..display.control_chart import control_chart
        from ..display.html import tag
        from ..display.notebook import view

        dates = [log.date for log in self.series.logs]
        changes = [(c.profile.first, self.sentence(c)) for c in self.changes]
        named = {c.direction.name for c in self.changes if c.direction is not None}
        shown = [c for c in self.charts() if c.name in named or c.outside][:4]
        return view(
            VERDICTS[self.verdict],
            f"{len(dates)} logs of {self.series.name} from {self.dated(0)} to "
            f"{self.dated(len(dates) - 1)}",
            tag("ul", *(tag("li", text) for _, text in changes)) if changes else "",
            *(
                control_chart(
                    c.name, dates, c.values, c.deviations, (c.centre, c.low, c.high),
                    baseline=self.baseline, changes=changes, outside=c.outside,
                )
                for c in shown
            ),
            *(tag("p", f"mind: {text}") for text in self.warnings),
        )  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """What `--json` prints."""
        problem = self.series.problem
        return {
            "dataset": self.series.name,
            "system": problem.file.name,
            "verdict": self.verdict,
            "changes": [self.entry(change) for change in self.changes],
            "dated_by": self.series.dated,
            "logs": [
                {"name": log.name, "date": self.dated(k), "runs": list(log.runs)}
                for k, log in enumerate(self.series.logs)
            ],
            "excitations": len(self.patterns.problem.runs),
            "baseline": self.baseline,
            "false_alarm_rate": self.rate,
            "tests": self.found.tests,
            "parameters": {c.name: c.to_dict() for c in self.parameter_charts()},
            "effects": {c.name: c.to_dict() for c in self.effect_charts()},
            "channels": {
                channel.name: chart.to_dict()
                for channel, chart in zip(problem.channels, self.channel_charts(), strict=True)
            },
            "warnings": list(self.warnings),
            "evaluations": self.patterns.evaluations,
            "wall_s": self.wall,
        }  # fmt: skip


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _numbers(values: Vector) -> list[float | None]:
    return [_number(value) for value in values.tolist()]
