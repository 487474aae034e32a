"""Which axes the plots of a scenario have."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..errors import listing

_KEYS = {
    "label", "signals", "paths", "comparisons", "names", "unit", "minus", "after", "before",
    "error_unit",
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
        error_unit: of the errors below it, in a figure, "" for the signals' own.
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
    error_unit: str = ""

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
        error_unit=str(entry.get("error_unit", "")),
    )


_FIGURE_KEYS = {
    "name", "title", "runs", "together", "columns", "errors", "plots", "quantities",
}  # fmt: skip


@dataclass(frozen=True)
class FigureSpec:
    """A picture of one run, or of several together.

    Attributes:
        name: part of the file's name.
        title: above it, the scenario's name if "".
        runs: that are drawn, () for all.
        together: all of them in one picture, else one picture each.
        columns: of axes beside each other.
        errors: below axes whose signals are compared, how far they are off.
        plots: its axes, row by row.
        quantities: of checks, over the runs, instead of axes.
    """

    name: str
    title: str
    runs: tuple[str, ...]
    together: bool
    columns: int
    errors: bool
    plots: tuple[Axes, ...]
    quantities: tuple[str, ...]


def read_figure(entry: Mapping[str, Any]) -> FigureSpec:
    """A figure from its table in a scenario.

    Raises:
        ValueError: incomplete or contradictory.
    """
    name, columns = str(entry.get("name", "")), entry.get("columns", 1)
    for key in entry:
        if key not in _FIGURE_KEYS:
            raise ValueError(
                f"figure {name!r} has no key {key!r}; {listing(sorted(_FIGURE_KEYS), key)}"
            )
    if not name or "/" in name:
        raise ValueError(f"a figure needs a name without slashes, not {name!r}")
    if bool(entry.get("plots")) == bool(entry.get("quantities")):
        raise ValueError(f"figure {name!r}: give plots as in [[plots]], or quantities of checks")
    if columns != int(columns) or columns < 1:
        raise ValueError(f"figure {name!r}: columns is {columns}; give a whole number above 0")
    return FigureSpec(
        name=name,
        title=str(entry.get("title", "")),
        runs=tuple(map(str, entry.get("runs", ()))),
        together=bool(entry.get("together", False)) or "quantities" in entry,
        columns=int(columns),
        errors=bool(entry.get("errors", False)),
        plots=tuple(read_axes(item) for item in entry.get("plots", ())),
        quantities=tuple(map(str, entry.get("quantities", ()))),
    )
