"""Plots that zoom and tell values: panels over one axis, drawn by `assets/plot.js`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from .html import Html, join, tag
from .series import script_data


@dataclass(frozen=True)
class Curve:
    """A line of a panel. Names of signals are those of the page's store, `{run}` is the run's.

    Attributes:
        name: as shown, "" for a line without a key.
        colour: `measured`, `before`, `after`, `other`, `fourth` or `fifth`.
        x, y: signals; where there is a signal `y^`, it has the largest values, y the smallest.
        less: two signals whose difference is meant where there is no signal y.
        width: [px].
        fill: opacity of the area between smallest and largest values.
        dots: whether samples are marked when few are in sight.
    """

    name: str
    colour: str
    x: str
    y: str
    less: tuple[str, str] | None = None
    width: float = 1.4
    fill: float = 0.75
    dots: bool = False

    def to_dict(self) -> dict[str, Any]:
        """For the script."""
        return {
            "name": self.name, "colour": self.colour, "x": self.x, "y": self.y,
            "less": self.less, "width": self.width, "fill": self.fill, "dots": self.dots,
        }  # fmt: skip


@dataclass(frozen=True)
class Panel:
    """Curves with one scale.

    Attributes:
        title: quantity and unit.
        curves: those behind first.
        band: shades from -band to band.
        height: [px].
        short: quantity, where values are read.
    """

    title: str
    curves: Sequence[Curve]
    band: float | None = None
    height: int = 170
    short: str = ""

    def to_dict(self) -> dict[str, Any]:
        """For the script."""
        return {
            "title": self.title, "lines": [curve.to_dict() for curve in self.curves],
            "band": self.band, "height": self.height, "short": self.short,
        }  # fmt: skip


def plot(
    label: str, panels: Sequence[Panel], *, axis: str, cursor: str = "", group: str = "",
    runs: Mapping[str, str] | None = None,
) -> Html:  # fmt: skip
    """A plot; "" without panels.

    Args:
        label: what it shows, for those who do not see it.
        panels: from the top.
        axis: name and unit of the common axis.
        cursor: its short name.
        group: plots of one group zoom together.
        runs: name -> as shown; `{run}` in names of signals is the chosen one.
    """
    if not panels:
        return Html("")
    content: dict[str, Any] = {
        "label": label, "axis": axis, "cursor": cursor, "group": group or label,
        "panels": [panel.to_dict() for panel in panels],
    }  # fmt: skip
    if runs is not None:
        content |= {"runs": list(runs), "runNames": dict(runs)}
    hint = tag("noscript", "This plot needs JavaScript; the tables have all figures.")
    return tag("div", join(script_data(content), hint), class_="plot")
