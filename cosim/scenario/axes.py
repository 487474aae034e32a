"""Which axes the plots of a scenario have."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

_KEYS = {
    "label", "signals", "paths", "comparisons", "names", "unit", "minus", "after", "before",
}  # fmt: skip


@dataclass(frozen=True)
class Axes:
    """One axes of a plot.

    Attributes:
        label: of the vertical axis, without unit.
        signals: drawn over time (vectors too).
        paths: pairs of signals, drawn one over the other with equal scales.
        comparisons: names of comparisons whose differences are drawn over time.
        names: in the legend, for signals, paths or comparisons in order.
        unit: to convert to, "" for the signals' own.
        minus: signal that is subtracted from all, "" for none.
        after, before: times between which it is drawn [s].
    """

    label: str
    signals: tuple[str, ...]
    paths: tuple[tuple[str, str], ...]
    comparisons: tuple[str, ...]
    names: tuple[str, ...]
    unit: str
    minus: str
    after: float
    before: float

    @property
    def needs(self) -> tuple[str, ...]:
        """Signals that have to be recorded for it."""
        names = (*self.signals, *(name for pair in self.paths for name in pair))
        return (*names, self.minus) if self.minus else names


def read_axes(entry: Mapping[str, Any]) -> Axes:
    """One axes from its table in a scenario.

    Raises:
        ValueError: incomplete or contradictory.
    """
    what = f"plot {entry.get('label', '')!r}"
    unknown = sorted(set(entry) - _KEYS)
    if unknown:
        raise ValueError(f"{what} has no key {unknown[0]!r}; one of {', '.join(sorted(_KEYS))}")
    signals = tuple(entry.get("signals", ()))
    paths = tuple((str(pair[0]), str(pair[1])) for pair in entry.get("paths", ()))
    comparisons = tuple(entry.get("comparisons", ()))
    names = tuple(str(name) for name in entry.get("names", ()))
    if bool(signals) + bool(paths) + bool(comparisons) != 1:
        raise ValueError(f"{what}: give signals, or paths (pairs of signals), or comparisons")
    lines = len(signals or paths or comparisons)
    if names and len(names) != lines:
        raise ValueError(f"{what}: {len(names)} names for {lines} lines")
    return Axes(
        label=str(entry.get("label", "")),
        signals=signals,
        paths=paths,
        comparisons=comparisons,
        names=names,
        unit=str(entry.get("unit", "")),
        minus=str(entry.get("minus", "")),
        after=float(entry.get("after", float("-inf"))),
        before=float(entry.get("before", float("inf"))),
    )
