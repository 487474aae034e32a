"""Control charts: a quantity by date, the limits within which it stays by chance, and changes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import datetime
from html import escape

import numpy as np
from numpy.typing import NDArray

from .chart import ticks
from .html import Html, number

Vector = NDArray[np.float64]
WIDTH, HEIGHT = 460.0, 210.0
LEFT, RIGHT, TOP, BOTTOM = 58.0, 10.0, 26.0, 24.0
LABEL = 22.0
"""Half a date's label [px]."""
MONTHS = (1, 2, 3, 6, 12, 24, 60)
"""Between ticks of the dates."""
DATES = 6
"""Ticks of dates at most."""
DAY = 86400.0


def control_chart(
    title: str,
    dates: Sequence[datetime],
    values: Vector,
    deviations: Vector,
    limits: tuple[float, float, float],
    *,
    baseline: int,
    changes: Sequence[tuple[int, str]] = (),
    outside: Sequence[int] = (),
) -> Html:
    """A chart as SVG, readable without scripts.

    Args:
        title: quantity and unit.
        dates: of the logs, rising.
        values, deviations: by log; NaN are gaps.
        limits: centre, lower and upper limit; NaN for none.
        baseline: number of logs that the limits come from.
        changes: index of the first log that differs, and what is said of it.
        outside: indices of logs beyond the limits.
    """
    days = np.array([(when - dates[0]).total_seconds() / DAY for when in dates])
    span = max(float(days[-1]), 1e-9)
    known = np.isfinite(values)
    edge = np.where(np.isfinite(deviations), deviations, 0.0)
    shown = [*(values - edge)[known], *(values + edge)[known], *limits[1:]]
    shown = [value for value in shown if math.isfinite(value)]
    low, high = (min(shown), max(shown)) if shown else (0.0, 1.0)
    room = 0.06 * (high - low) or 0.5 * abs(high) or 1.0
    low, high = low - room, high + room

    def px(day: float) -> float:
        return LEFT + 4.0 + day / span * (WIDTH - LEFT - RIGHT - 8.0)

    def py(value: float) -> float:
        return TOP + (high - value) / (high - low) * (HEIGHT - TOP - BOTTOM)

    line, soft = "var(--line,#e3e8ee)", "var(--soft,#5b6875)"
    parts = [
        f'<text x="{LEFT:g}" y="14" font-weight="600" fill="var(--ink,#1f2933)">'
        f"{escape(title)}</text>"
    ]
    for value in ticks(low, high, 5):
        parts.append(
            f'<path d="M{LEFT:g} {py(value):.1f}H{WIDTH - RIGHT:g}" stroke="{line}"/>'
            f'<text x="{LEFT - 5:g}" y="{py(value) + 4:.1f}" text-anchor="end" fill="{soft}">'
            f"{number(value)}</text>"
        )
    for day, label in _dates(dates[0], span):
        at = min(px(day), WIDTH - LABEL)  # a label at the edge stays inside
        parts.append(
            f'<text x="{at:.1f}" y="{HEIGHT - 7:g}" text-anchor="middle" fill="{soft}">'
            f"{label}</text>"
        )
    centre, lower, upper = limits
    if math.isfinite(lower) and math.isfinite(upper):
        first, end = px(0.0) - 4.0, WIDTH - RIGHT
        parts.append(
            f'<rect x="{first:.1f}" y="{py(upper):.1f}" width="{end - first:.1f}" '
            f'height="{py(lower) - py(upper):.1f}" fill="var(--good,#15703a)" opacity=".1"/>'
            f'<path d="M{first:.1f} {py(upper):.1f}H{end:g}M{first:.1f} {py(lower):.1f}H{end:g}" '
            'stroke="var(--good,#15703a)" stroke-dasharray="4 3" fill="none"/>'
            f'<path d="M{first:.1f} {py(centre):.1f}H{end:g}" stroke="var(--good,#15703a)"/>'
        )
    for index, text in changes:
        at = px(days[index] if index == 0 else 0.5 * (days[index] + days[index - 1]))
        parts.append(
            f'<path d="M{at:.1f} {TOP - 4:g}V{HEIGHT - BOTTOM:g}" stroke="var(--bad,#b3400a)" '
            f'stroke-width="1.6"><title>{escape(text)}</title></path>'
        )
    beyond = set(outside)
    for index in np.flatnonzero(known).tolist():
        colour = "var(--bad,#b3400a)" if index in beyond else "var(--after,#0b6fb8)"
        x, y = px(days[index]), py(values[index])
        label = f"{dates[index]:%Y-%m-%d}: {number(float(values[index]))}"
        if edge[index] > 0.0:
            label += f" ± {number(float(edge[index]))}"
            parts.append(
                f'<path d="M{x:.1f} {py(values[index] - edge[index]):.1f}'
                f'V{py(values[index] + edge[index]):.1f}" stroke="{colour}" opacity=".5"/>'
            )
        inside = "var(--paper,#fff)" if index < baseline else colour
        parts.append(
            f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.7" fill="{inside}" stroke="{colour}" '
            f'stroke-width="1.3"><title>{label}</title></circle>'
        )
    return Html(
        f'<svg viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" aria-label="{escape(title)} by date" '
        'style="width:100%;height:auto;font:11px system-ui,sans-serif">'
        f"{''.join(parts)}</svg>"
    )


def _dates(first: datetime, span: float) -> list[tuple[float, str]]:
    """Ticks [d] and their labels: first days of months, or days where there are few."""
    months = next((m for m in MONTHS if span / (30.4 * m) <= DATES), MONTHS[-1])
    found = []
    year, month = first.year, first.month
    while True:
        month += 1
        if month > 12:
            year, month = year + 1, 1
        when = datetime(year, month, 1)
        day = (when - first).total_seconds() / DAY
        if day > span:
            break
        if (month - 1) % months == 0:
            found.append((day, f"{when:%Y-%m}"))
    if len(found) < 2:
        stamps = [span * k / 3.0 for k in range(4)]
        pattern = "%m-%d" if span > 4.0 else "%m-%d %H:%M"
        base = first.timestamp()
        return [(s, datetime.fromtimestamp(base + s * DAY).strftime(pattern)) for s in stamps]
    return found
