"""Line charts as inline SVG, for where no script runs: notebooks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .html import Html, join, tag

Vector = NDArray[np.float64]
POINTS = 600
"""Points per line: more cannot be seen."""
COLOURS = (
    "#0b6fb8", "#c2500a", "#15803d", "#7c3aed", "#b45309", "#0e7490", "#be185d", "#4b5563",
)  # fmt: skip
GREY = "#8a94a0"


@dataclass(frozen=True)
class Line:
    """A line of a chart."""

    name: str
    x: Vector
    y: Vector
    colour: str = COLOURS[0]


def ticks(low: float, high: float, count: int = 4) -> list[float]:
    """Round numbers between two values."""
    if not high > low:
        return [low]
    rough = (high - low) / count
    power = 10.0 ** np.floor(np.log10(rough))
    step = next(power * f for f in (1, 2, 5, 10) if power * f >= rough)
    first = np.ceil(low / step) * step
    return [float(v) + 0.0 for v in np.arange(first, high + 1e-9 * step, step)]  # no -0


def thinned(line: Line) -> Line:
    """At most `POINTS` points, smallest and largest of each stretch, so that no peak is lost."""
    good = np.isfinite(line.x) & np.isfinite(line.y)
    x, y = line.x[good], line.y[good]
    if x.size <= POINTS:
        return Line(line.name, x, y, line.colour)
    edges = np.linspace(0, x.size, POINTS // 2 + 1).astype(int)
    keep: list[int] = []
    for a, b in pairwise(edges.tolist()):
        if b > a:
            keep += sorted({a + int(np.argmin(y[a:b])), a + int(np.argmax(y[a:b]))})
    return Line(line.name, x[keep], y[keep], line.colour)


def lines(
    items: Sequence[Line], *, title: str, x_label: str = "time [s]", band: float | None = None,
    width: int = 720, height: int = 190,
) -> Html:  # fmt: skip
    """A chart of lines with its key; `band` shades +- a value (the noise); "" without points."""
    drawn = [line for line in (thinned(item) for item in items) if line.x.size]
    if not drawn:
        return Html("")
    left, right, top, bottom = 58, 10, 22, 34
    low_x = min(float(v.x.min()) for v in drawn)
    high_x = max(float(v.x.max()) for v in drawn)
    low = min(float(v.y.min()) for v in drawn)
    high = max(float(v.y.max()) for v in drawn)
    if band is not None:
        low, high = min(low, -band), max(high, band)
    margin = 0.05 * (high - low) or max(1.0, 0.05 * abs(high))  # 1 is lost beside 1e16
    low, high = low - margin, high + margin
    if high_x <= low_x:
        high_x = low_x + 1.0

    def px(x: float) -> float:
        return left + (x - low_x) / (high_x - low_x) * (width - left - right)

    def py(y: float) -> float:
        return top + (high - y) / (high - low) * (height - top - bottom)

    parts = [
        f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="{escape(title)}">',
        f'<text x="{left}" y="14" class="title">{escape(title)}</text>',
    ]
    if band is not None:
        parts.append(
            f'<rect x="{left}" y="{py(band):.1f}" width="{width - left - right}" '
            f'height="{py(-band) - py(band):.1f}" fill="#e5e7eb"/>'
        )
    for value in ticks(low, high):
        parts.append(
            f'<path d="M{left} {py(value):.1f}H{width - right}" stroke="#e3e8ee"/>'
            f'<text x="{left - 6}" y="{py(value) + 4:.1f}" text-anchor="end">{value:g}</text>'
        )
    for value in ticks(low_x, high_x, 6):
        parts.append(
            f'<text x="{px(value):.1f}" y="{height - bottom + 15}" text-anchor="middle">'
            f"{value:g}</text>"
        )
    parts.append(
        f'<text x="{(left + width - right) / 2}" y="{height - 5}" text-anchor="middle">'
        f"{escape(x_label)}</text>"
    )
    for line in drawn:
        path = " ".join(
            f"{px(a):.1f},{py(b):.1f}"
            for a, b in zip(line.x.tolist(), line.y.tolist(), strict=True)
        )
        parts.append(
            f'<polyline points="{path}" fill="none" stroke="{line.colour}" stroke-width="1.2"/>'
        )
    parts.append("</svg>")
    keys = [
        tag("span", tag("i", style=f"background:{line.colour}"), line.name, class_="key")
        for line in drawn if len(drawn) > 1 and line.name
    ]  # fmt: skip
    return join(Html("".join(parts)), tag("div", *keys) if keys else "")
