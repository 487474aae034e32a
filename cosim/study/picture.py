"""The picture of a study: error against cost."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from ..display.literal import literal
from ..files import atomic
from .table import StudyTable

SPREAD = 4.0
"""Ratio of the largest to the smallest value from which on an axis is logarithmic."""


def plot(table: StudyTable, title: str, path: Path) -> None:
    """Error against cost: one axes per error, one line per variant over its steps.

    Runs that differ in parameters only are one point at their medians, with a bar from the smallest
    to the largest error. Errors are those against the reference run where there is one, else those
    against what the scenario compares with.
    """
    from matplotlib.figure import Figure

    done = [row for row in table.rows if row["status"] == "ok"]
    cost = "cpu" if all(row.get("cpu") for row in done) else "wall"
    rows = [row for row in done if row.get(cost) and not row["role"]]
    known = [name for name in table.errors if any(row.get(name) for row in rows)]
    names = [name for name in known if name.startswith("error.")] or known
    keys = [name for name in table.varied if not name.startswith("param.")]
    lines = _grouped(rows, [name for name in keys if name != "step"] or keys)
    count = max(len(names), 1)
    across = min(count, 3)
    down = math.ceil(count / across)
    figure = Figure(figsize=(1.0 + 4.2 * across, 1.2 + 3.4 * down), layout="constrained")
    axes = figure.subplots(down, across, squeeze=False).ravel()
    for axis, name in zip(axes, names, strict=False):
        for index, (label, members) in enumerate(lines):
            points = _points(members, name, cost)
            if not points:
                continue
            x, y, low, high = zip(*points, strict=True)
            bars = [[b - a for a, b in zip(low, y, strict=True)],
                    [b - a for a, b in zip(y, high, strict=True)]]  # fmt: skip
            axis.errorbar(
                x, y, yerr=bars if any(map(any, bars)) else None, marker="osD^vP*X"[index % 8],
                label=label, linewidth=1.0, markersize=5.0, capsize=3.0, alpha=0.8,
            )  # fmt: skip
        _scale(axis, "x", [row[cost] / row["simulated"] * 1e3 for row in rows])
        _scale(axis, "y", [row[name] for row in rows if row.get(name)])
        unit = table.units.get(name, "")
        axis.set_ylabel(f"{name}" + (f" [{unit}]" if unit else ""))
        axis.set_xlabel(f"{'CPU' if cost == 'cpu' else 'wall'} time per simulated second [ms]")
        axis.grid(True, which="both", alpha=0.3)
    for axis in axes[len(names) :]:
        axis.set_visible(not names)
        axis.text(0.5, 0.5, "nothing to compare with", ha="center", transform=axis.transAxes)
    handles, labels = axes[0].get_legend_handles_labels()
    if 1 < len(labels) <= 16:
        figure.legend(handles, labels, loc="outside lower center", ncols=2, fontsize="small")
    figure.suptitle(title)
    with atomic(path) as temporary:
        literal(figure).savefig(temporary, dpi=120)


def _points(
    rows: Iterable[dict[str, Any]], name: str, cost: str
) -> list[tuple[float, float, float, float]]:
    """Cost, error, smallest and largest error of the runs of each step, largest step first."""
    steps: dict[float, list[dict[str, Any]]] = {}
    for row in rows:
        if row.get(name):
            steps.setdefault(row["step"], []).append(row)
    found = []
    for _, members in sorted(steps.items(), reverse=True):
        errors = [row[name] for row in members]
        costs = [row[cost] / row["simulated"] * 1e3 for row in members]
        middle = statistics.median(errors)
        found.append((statistics.median(costs), middle, min(errors), max(errors)))
    return found


def _scale(axis: Any, which: str, values: Sequence[float]) -> None:
    """Logarithmic with 1, 2 and 5 of each decade where values spread, else linear from zero."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    if not values or max(values) <= SPREAD * min(values):
        getattr(axis, f"set_{which}lim")(0.0, 1.08 * max(values, default=1.0))
        return
    getattr(axis, f"set_{which}scale")("log")
    if max(values) < 100.0 * min(values):
        line = getattr(axis, f"{which}axis")
        line.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        line.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        line.set_minor_formatter(NullFormatter())


def _grouped(
    rows: Iterable[dict[str, Any]], keys: Sequence[str]
) -> list[tuple[str, list[dict[str, Any]]]]:
    groups: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        parts = [f"{row[name]:g} s" if name == "step" else str(row.get(name) or "-")
                 for name in keys]  # fmt: skip
        groups.setdefault(", ".join(parts), []).append(row)
    return list(groups.items())
