"""Pictures of a calibration, as papers print them: each run before and after, and tornado plots."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..calibrate.sensitivity import Correlation
from ..display.literal import literal
from ..files import atomic, make_folder

if TYPE_CHECKING:
    from ..calibrate.estimate import Estimate

Vector = NDArray[np.float64]
COLUMNS = 3
"""Of axes beside each other."""
SIZE = (4.4, 3.2)
"""Of a channel's two axes [inch]."""
STYLES = {
    "measured": {"color": "black", "linewidth": 2.2, "alpha": 0.55},
    "first guess": {"color": "tab:orange", "linewidth": 1.1},
    "calibrated": {"color": "tab:blue", "linewidth": 1.1},
}


def first_guess(estimate: Estimate) -> dict[str, Vector]:
    """Residuals over sigma of all runs at the nominal values, start values as calibrated."""
    problem = estimate.problem
    theta = estimate.theta.copy()
    for i, p in enumerate(problem.parameters):
        if p.role != "nuisance" and not p.run:
            theta[i] = p.nominal
    return dict(estimate.simulator.residuals(theta, None))


def run_pictures(
    estimate: Estimate, before: Mapping[str, Vector], after: Mapping[str, Vector], folder: Path
) -> list[Path]:
    """One picture per run: measured, first guess and calibrated, and the errors below.

    Args:
        estimate: what was fitted.
        before, after: run -> residuals over sigma.
        folder: for the pictures.

    Returns:
        The files, `RUN.png`.
    """
    from matplotlib.figure import Figure

    make_folder(folder)
    problem, written = estimate.problem, []
    for run in problem.runs:
        shown = [
            i for i in range(len(problem.channels)) if np.isfinite(run.data[:, i]).any()
        ]  # fmt: skip
        times = run.logged
        rows = math.ceil(len(shown) / COLUMNS)
        columns = min(len(shown), COLUMNS)
        figure = Figure(
            figsize=(SIZE[0] * columns, SIZE[1] * rows + 0.7), layout="constrained"
        )  # fmt: skip
        grid = figure.add_gridspec(2 * rows, columns, height_ratios=[2.1, 1.1] * rows)
        for place, index in enumerate(shown):
            row, column = divmod(place, COLUMNS)
            upper = figure.add_subplot(grid[2 * row, column])
            lower = figure.add_subplot(grid[2 * row + 1, column], sharex=upper)
            channel = problem.channels[index]
            measured = run.data[:, index]
            upper.plot(times, measured, label="measured", **STYLES["measured"])  # type: ignore[arg-type]
            sizes = []
            for name, found in (("first guess", before), ("calibrated", after)):
                rest = found[run.name][:, index] * channel.sigma
                style: Any = STYLES[name]
                upper.plot(times, measured - rest, label=name, **style)
                lower.plot(times, -rest, **style)
                sizes.append(math.sqrt(float(np.nanmean(rest**2))))
            upper.set_ylabel(f"{channel.name} [{channel.unit}]")
            upper.tick_params(labelbottom=False)
            lower.set_ylabel("error")
            lower.set_xlabel("time [s]")
            lower.set_title(
                f"RMS {sizes[0]:.3g}, calibrated {sizes[1]:.3g}", fontsize="small", loc="right"
            )
            for axis in (upper, lower):
                axis.grid(True, alpha=0.3)
                axis.margins(x=0.01)
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
        figure.suptitle(f"{problem.name} {run.name} ({run.purpose})")
        path = folder / f"{run.name}.png"
        with atomic(path) as temporary:
            literal(figure).savefig(temporary, dpi=80)
        written.append(path)
    return written


def tornado_by_run(correlation: Correlation, path: Path) -> Path:
    """Draw the indices of each run, parameters in the order of all runs together."""
    from matplotlib.figure import Figure

    names = sorted(correlation.index, key=lambda name: abs(correlation.index[name]))
    runs = list(correlation.by_run)
    columns = min(len(runs), COLUMNS)
    rows = math.ceil(len(runs) / columns)
    size = (1.0 + 2.9 * columns, 0.9 + (0.7 + 0.28 * len(names)) * rows)
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for axis, run in zip(axes, runs, strict=False):
        values = [correlation.by_run[run][name] for name in names]
        colours = ["tab:blue" if abs(v) > correlation.limit else "0.75" for v in values]
        axis.barh(names, values, color=colours)
        for side in (-1.0, 1.0):
            axis.axvline(side * correlation.limit, color="tab:red", linestyle="--", linewidth=1.0)
        axis.set_title(run, fontsize="medium")
        axis.set_xlim(-1.0, 1.0)
    for axis in axes[len(runs) :]:
        axis.remove()
    figure.supxlabel(
        f"correlation with the residual, {correlation.samples} sets; dashed: 5 % limit",
        fontsize="medium",
    )
    with atomic(path) as temporary:
        literal(figure).savefig(temporary, dpi=110)
    return path
