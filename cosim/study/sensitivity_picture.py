"""Pictures of sampled parameters: a tornado of their indices, and all runs as lines over them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..display.literal import literal
from ..files import atomic
from .definition import Study
from .sensitivity import Sensitivity, made_with, outputs, samples_of
from .table import StudyTable

Vector = NDArray[np.float64]
MOST_AXES = 8
"""Tornados of one picture; more cannot be read."""
MOST_LINES = 2000
"""Runs drawn as lines: more are a grey area."""
MOST_OUTPUTS = 3
"""Results that stand beside the parameters."""
LABELS = {
    "ST": "share of the variance: alone (dark), with others (light)",
    "mu_star": "mean size of the elementary effects; dot: their standard deviation",
    "correlation": "rank correlation; dashed: 5 % limit",
}


def tornado(found: Sequence[Sensitivity], title: str, path: Path) -> None:
    """Draw the indices of each result of each variant, the largest at the top."""
    from matplotlib.figure import Figure

    shown = found[:MOST_AXES]
    across = min(len(shown), 2)
    down = math.ceil(len(shown) / across)
    most = max(len(item.indices) for item in shown)
    figure = Figure(figsize=(6.2 * across, (1.3 + 0.32 * most) * down + 0.6), layout="constrained")
    axes = figure.subplots(down, across, squeeze=False).ravel()
    for axis, item in zip(axes, shown, strict=False):
        _tornado(axis, item)
    for axis in axes[len(shown) :]:
        axis.set_visible(False)
    left = f"; {len(found) - len(shown)} more in sensitivity.csv" if len(found) > len(shown) else ""
    figure.suptitle(title + left)
    with atomic(path) as temporary:
        literal(figure).savefig(temporary, dpi=120)


def _tornado(axis: Any, item: Sensitivity) -> None:
    names = item.ordered()[::-1]
    values = [item.indices[name][item.main] for name in names]
    widths = [item.half_width(name) for name in names]
    colors = ["tab:blue" if item.significant(name) else "0.75" for name in names]
    if item.main == "ST":
        axis.barh(names, values, color=colors, alpha=0.45)
        axis.barh(names, [item.indices[n]["S1"] for n in names], color=colors, height=0.4)
    else:
        axis.barh(names, values, color=colors)
    if all(width is not None for width in widths):
        axis.errorbar(values, names, xerr=widths, fmt="none", ecolor="0.2", capsize=3.0)
    if item.main == "mu_star":
        axis.plot([item.indices[n]["sigma"] for n in names], names, "o", color="tab:orange")
    if item.limit is not None:
        for side in (-1.0, 1.0):
            axis.axvline(side * item.limit, color="tab:red", linestyle="--", linewidth=1.0)
        axis.set_xlim(-1.0, 1.0)
    unit = f" [{item.unit}]" if item.unit and item.main == "mu_star" else ""
    axis.set_xlabel(LABELS[item.main] + unit, fontsize="small")
    variant = f" ({made_with(item.made)})" if item.made else ""
    axis.set_title(f"{item.output}{variant}, {item.runs} runs", fontsize="medium")


def parallel(
    study: Study, table: StudyTable, points: Sequence[str], title: str, path: Path
) -> bool:
    """Draw each run as a line over its parameters and results; False if there is nothing to draw.

    The colour is the first result's rank, so that bundles show which values make it large.
    """
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

    names = [n for n in outputs(table) if any(row.get(n) is not None for row in table.rows)]
    names = names[:MOST_OUTPUTS]
    blocks = samples_of(study, table, points)
    if not names or not blocks:
        return False
    columns: dict[str, Vector] = {}
    for name in study.sampled:
        parts = [b.values.get(name, np.full(len(b.rows), math.nan)) for b in blocks]
        columns[name] = np.concatenate(parts)
    for name in names:
        columns[name] = np.concatenate([block.output(name) for block in blocks])
    data = np.array(list(columns.values()))
    data = data[:, np.isfinite(data).all(axis=0)]  # a line over all
    if not data.shape[1]:
        return False
    data = data[:, :: math.ceil(data.shape[1] / MOST_LINES)]
    logarithmic = [n in study.sampled and study.sampled[n].kind == "log_uniform" for n in columns]
    scaled = np.array(
        [_scaled(np.log(r) if log else r) for r, log in zip(data, logarithmic, strict=True)]
    )
    order = np.argsort(np.argsort(data[len(study.sampled)], kind="stable"), kind="stable")
    figure = Figure(figsize=(1.5 + 1.7 * len(columns), 4.6), layout="constrained")
    axis = figure.subplots()
    x = np.arange(len(columns), dtype=float)
    lines = LineCollection(
        [np.column_stack([x, y]) for y in scaled.T], array=order / max(len(order) - 1, 1),
        cmap="viridis", linewidths=0.8, alpha=min(1.0, 60.0 / len(order) + 0.15),
    )  # fmt: skip
    axis.add_collection(lines)
    axis.set_xlim(-0.3, len(columns) - 0.7)
    axis.set_ylim(-0.12, 1.12)
    for place, row in zip(x, data, strict=True):
        axis.axvline(place, color="0.3", linewidth=0.8)
        for y, value in ((1.07, row.max()), (-0.07, row.min())):
            axis.text(place, y, f"{value:.4g}", ha="center", va="center", fontsize="small")
    units = [f" [{table.units[n]}]" if table.units.get(n) else "" for n in columns]
    logs = [", log" if log else "" for log in logarithmic]
    axis.set_xticks(x, [n + u + g for n, u, g in zip(columns, units, logs, strict=True)],
                    rotation=20.0, ha="right")  # fmt: skip
    axis.set_yticks([])
    axis.spines[:].set_visible(False)
    bar = figure.colorbar(lines, ax=axis, ticks=[0.0, 1.0], pad=0.01)
    bar.ax.set_yticklabels(["smallest", "largest"])
    bar.set_label(names[0])
    figure.suptitle(f"{title}: {data.shape[1]} of {len(table.rows)} runs")
    with atomic(path) as temporary:
        literal(figure).savefig(temporary, dpi=120)
    return True


def _scaled(row: Vector) -> Vector:
    span = np.ptp(row)
    found: Vector = (row - row.min()) / span if span else np.full(len(row), 0.5)
    return found
