"""A whole page with its style and scripts inside: one file that works without a network."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from pathlib import Path

from .html import Html, join, tag, text
from .series import Store

ASSETS = Path(__file__).parent / "assets"


@cache
def asset(name: str) -> str:
    """A file that pages carry."""
    return (ASSETS / name).read_text(encoding="utf-8")


def document(title: str, *parts: object, signals: Store | None = None) -> str:
    """A page.

    Args:
        title: of its window.
        parts: its body.
        signals: that its plots show.
    """
    shown = [text(part) for part in parts if part]
    body = join(
        *(join(part, "\n") for part in shown),
        signals.html if signals is not None else "",
        Html(f"<script>{asset('page.js')}</script>"),
        Html(f"<script>{asset('plot.js')}</script>") if signals is not None else "",
    )
    head = join(
        Html('<meta charset="utf-8">'),
        Html('<meta name="viewport" content="width=device-width,initial-scale=1">'),
        Html('<meta name="color-scheme" content="light dark">'),
        Html('<link rel="icon" href="data:,">'),  # else browsers ask a server for one
        tag("title", title),
        Html(f"<style>{asset('page.css')}</style>"),
    )
    return f'<!doctype html>\n<html lang="en"><head>{head}</head>\n<body>{body}</body></html>\n'


def section(name: str, title: str, *parts: object) -> Html:
    """A section that can be jumped to; "" without content."""
    body = join(*parts)
    return tag("section", tag("h2", title), body, id=name) if body else Html("")


def links(sections: Iterable[str]) -> Html:
    """Links to the sections that are there."""
    found = []
    for part in sections:
        name = part.partition('id="')[2].partition('"')[0]
        title = part.partition("<h2>")[2].partition("</h2>")[0]
        if name and title:
            found.append(tag("a", Html(title), href=f"#{name}"))
    return tag("nav", *found, class_="jump", aria_label="sections")
