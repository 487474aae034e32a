"""Line and bar charts as inline SVG."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
POINTS = 600
"""Points per line: more cannot be seen."""
COLOURS = ("#888888", "#0b6fb8", "#c2410c", "#15803d")


@dataclass(frozen=True)
class Line:
    """A line of a chart."""

    name: str
    x: Vector
    y: Vector
    colour: str = COLOURS[1]


def ticks(low: float, high: float, count: int = 4) -> list[float]:
    """Round numbers between two values."""
    if not high > low:
        return [low]
    rough = (high - low) / count
    power = 10.0 ** np.floor(np.log10(rough))
    step = next(power * f for f in (1, 2, 5, 10) if power * f >= rough)
    first = np.ceil(low / step) * step
    return [float(v) for v in np.arange(first, high + 1e-9 * step, step)]


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
    items: Sequence[Line], *, title: str, x_label: str, y_label: str, band: float | None = None,
    width: int = 640, height: int = 200,
) -> str:  # fmt: skip
    """A chart of lines; `band` shades +- a value (the noise)."""
    drawn = [line for line in (thinned(item) for item in items) if line.x.size]
    if not drawn:
        return ""
    left, right, top, bottom = 64, 12, 26, 38
    low_x = min(float(v.x.min()) for v in drawn)
    high_x = max(float(v.x.max()) for v in drawn)
    low = min(float(v.y.min()) for v in drawn)
    high = max(float(v.y.max()) for v in drawn)
    if band is not None:
        low, high = min(low, -band), max(high, band)
    margin = 0.05 * (high - low) or 1.0
    low, high = low - margin, high + margin
    if high_x <= low_x:
        high_x = low_x + 1.0

    def px(x: float) -> float:
        return left + (float(x) - low_x) / (high_x - low_x) * (width - left - right)

    def py(y: float) -> float:
        return top + (high - float(y)) / (high - low) * (height - top - bottom)

    parts = [
        f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="{escape(title)}">',
        f'<text x="{left}" y="15" class="title">{escape(title)}</text>',
    ]
    if band is not None:
        parts.append(
            f'<rect x="{left}" y="{py(band):.1f}" width="{width - left - right}" '
            f'height="{py(-band) - py(band):.1f}" fill="#e5e7eb"/>'
        )
    for value in ticks(low, high):
        parts.append(
            f'<line x1="{left}" x2="{width - right}" y1="{py(value):.1f}" y2="{py(value):.1f}" '
            f'stroke="#eee"/><text x="{left - 6}" y="{py(value) + 4:.1f}" text-anchor="end">'
            f"{value:g}</text>"
        )
    for value in ticks(low_x, high_x, 6):
        parts.append(
            f'<text x="{px(value):.1f}" y="{height - bottom + 15}" text-anchor="middle">'
            f"{value:g}</text>"
        )
    parts.append(
        f'<text x="{(left + width - right) / 2}" y="{height - 6}" text-anchor="middle">'
        f'{escape(x_label)}</text><text transform="translate(12,{(top + height - bottom) / 2}) '
        f'rotate(-90)" text-anchor="middle">{escape(y_label)}</text>'
    )
    for number, line in enumerate(drawn):
        path = " ".join(f"{px(a):.1f},{py(b):.1f}" for a, b in zip(line.x, line.y, strict=True))
        parts.append(
            f'<polyline points="{path}" fill="none" stroke="{line.colour}" stroke-width="1"/>'
        )
        if len(drawn) > 1:
            x = width - right - 110 * (len(drawn) - number)
            parts.append(
                f'<text x="{x + 16}" y="15">{escape(line.name)}</text>'
                f'<line x1="{x}" x2="{x + 12}" y1="11" y2="11" stroke="{line.colour}" '
                'stroke-width="3"/>'
            )
    parts.append("</svg>")
    return "".join(parts)
