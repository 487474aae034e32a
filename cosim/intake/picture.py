"""A picture of a log: what moves in it, over time, in eight axes at most."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..display.literal import literal
from ..files import atomic
from .inspect import ColumnReport, FileReport, TopicReport

AXES = 8
"""Of a picture: more are too small to read."""
LINES = 6
"""Columns in one axis."""
POINTS = 4000
"""Of a line: a picture has fewer pixels."""


def groups(files: Sequence[FileReport]) -> list[tuple[str, str, TopicReport, list[ColumnReport]]]:
    """What belongs into one axis: file, unit, topic, and columns of this unit that move.

    Columns of unknown unit have an axis each.
    """
    found = []
    for file in files:
        for topic in file.topics:
            units: dict[str, list[ColumnReport]] = {}
            for column in topic.columns:
                if column.high > column.low:
                    unit = column.unit.unit
                    units.setdefault(unit or f"?{column.name}", []).append(column)
            label = file.source.path.name
            if len(file.topics) > 1:
                label += f" {topic.topic.name}"
            found += [(label, unit, topic, columns) for unit, columns in units.items()]
    return found


def draw(files: Sequence[FileReport], path: Path) -> tuple[Path, list[str]]:
    """Draw logs over time.

    Args:
        files: as inspected.
        path: of the picture; its end says its format.

    Returns:
        The path, and what did not find room.
    """
    from matplotlib.figure import Figure

    everything = groups(files)
    shown, rest = everything[:AXES], everything[AXES:]
    count = max(len(shown), 1)
    figure = Figure(figsize=(9.0, 1.7 * count + 0.7), layout="constrained")
    axes = figure.subplots(count, 1, squeeze=False)[:, 0]
    left = [f"{label}: {c.name}" for label, _, _, columns in rest for c in columns]
    for axis, (label, unit, topic, columns) in zip(axes, shown, strict=False):
        for column in columns[:LINES]:
            values = topic.topic.log[column.name]
            times = topic.clock.times
            if times.shape != values.shape:
                times = np.arange(values.size, dtype=np.float64)
            part = slice(None, None, max(values.size // POINTS, 1))
            axis.plot(times[part], values[part], linewidth=0.9, label=column.name)
        left += [f"{label}: {c.name}" for c in columns[LINES:]]
        axis.set_ylabel(f"[{unit}]" if not unit.startswith("?") else "unit unknown")
        axis.set_title(label, fontsize=9, loc="left")
        axis.legend(fontsize=8, loc="upper right")
        axis.grid(alpha=0.3)
        axis.set_xlabel("time [s]" if topic.clock.column else "row", fontsize=8)
        axis.tick_params(labelsize=8)
    with atomic(path) as temporary:
        literal(figure).savefig(temporary, dpi=110)
    return path, left
