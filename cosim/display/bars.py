"""Small bars in tables: where a value lies within its bounds, and how large an index is."""

from __future__ import annotations

import math

from .html import Html, number

WIDTH, HEIGHT = 150.0, 16.0
EDGE = 5.0
"""Room beside the bounds [px]."""


def _svg(label: str, *parts: str) -> Html:
    return Html(
        f'<svg class="bar" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" width="{WIDTH:g}" '
        f'height="{HEIGHT:g}" style="width:{WIDTH:g}px;height:{HEIGHT:g}px" role="img" '
        f'aria-label="{label}">{"".join(parts)}</svg>'
    )


def within(
    value: float, low: float, high: float, minimum: float, maximum: float, nominal: float
) -> Html:
    """A value with its interval between its bounds; a tick marks its nominal value."""
    span = maximum - minimum
    if not (span > 0.0 and math.isfinite(span)):
        return Html("")

    def x(of: float) -> float:
        return EDGE + min(max((of - minimum) / span, 0.0), 1.0) * (WIDTH - 2.0 * EDGE)

    middle = HEIGHT / 2.0
    label = (
        f"{number(value)} between {number(low)} and {number(high)}, bounds {number(minimum)} to "
        f"{number(maximum)}, nominal {number(nominal)}"
    )
    return _svg(
        label,
        f"<title>{label}</title>",
        f'<path d="M{EDGE} {middle}H{WIDTH - EDGE}" stroke="#b8c2cc" stroke-width="1.5"/>',
        f'<path d="M{x(nominal):.1f} 2V{HEIGHT - 2.0}" stroke="#8a94a0" stroke-width="1.5"/>',
        f'<path d="M{x(low):.1f} {middle}H{x(high):.1f}" stroke="#0b6fb8" stroke-width="5" '
        'opacity=".45"/>',
        f'<circle cx="{x(value):.1f}" cy="{middle}" r="4" fill="#0b6fb8"/>',
    )


def signed(value: float, limit: float | None = None) -> Html:
    """A bar from 0 for a value between -1 and 1; pale where it stays below a limit."""
    middle, half = WIDTH / 2.0, WIDTH / 2.0 - EDGE
    end = middle + min(max(value, -1.0), 1.0) * half
    weak = limit is not None and abs(value) <= limit
    marks = "".join(
        f'<path d="M{middle + side * limit * half:.1f} 1V{HEIGHT - 1.0}" stroke="#b3400a" '
        'stroke-dasharray="2 2"/>'
        for side in (-1.0, 1.0)
        if limit is not None
    )
    return _svg(
        number(value),
        f'<path d="M{middle} 1V{HEIGHT - 1.0}" stroke="#8a94a0"/>',
        f'<rect x="{min(middle, end):.1f}" y="3" width="{abs(end - middle):.1f}" height="10" '
        f'fill="{"#b8c2cc" if weak else "#0b6fb8"}"/>',
        marks,
    )
