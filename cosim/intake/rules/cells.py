"""Cells without a number, and columns of text."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...calibrate.checks.finding import Finding
from ...data.dates import advice
from ...reading.schema import shown
from ..clock import Clock
from ..topic import Topic


def check(topic: Topic, clock: Clock) -> Iterator[Finding]:
    """What is lacking, counted."""
    for name, gaps in topic.log.gaps.items():
        if name in topic.log.columns and not np.isfinite(topic.log[name]).any():
            yield Finding("warning", "empty", topic.name, name, "holds no number at all")
        else:
            yield Finding("note", "gaps", topic.name, name, str(gaps))
    for name, held in topic.log.texts.items():
        way = advice(held.example)
        text = held.fault or f"holds text, {shown(held.example)} first" + (way and f"; {way}")
        severity = "warning" if held.fault else "note"
        yield Finding(severity, "reading", topic.name, name, text)
    for note in (*topic.log.notes, *topic.notes):
        yield Finding("note", "reading", topic.name, "", note)
