"""Figures that scenarios choose: axes in rows and columns, errors below, of one run or several."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..data.comparison import Comparison
from ..errors import ScenarioError, listing
from ..scenario import scenario as scenarios
from ..scenario.axes import Axes, FigureSpec
from ..scenario.scenario import ScenarioFile
from ..system.provider import Provider
from .comparison_table import ComparedQuantity
from .plots import draw_comparisons, draw_courses, draw_paths, plot_overview, save
from .runner import Result, RunResult, run_scenario

if TYPE_CHECKING:
    from matplotlib.axes import Axes as MatplotlibAxes
    from matplotlib.figure import Figure

WIDTH, HEIGHT, ERRORS, PATHS = 4.4, 2.1, 1.1, 3.6
"""Of axes [inch]: width, heights of courses, of the errors below them, and of paths."""
ALONE = 6.0
"""Least width of a figure [inch]."""
DOTS = 72
"""Per inch: three columns are as wide as a page on a screen, in 100 kB."""


Shown = Mapping[str, tuple[Axes, RunResult]]
"""Run -> axes as that run has them, and its result."""


def draw(number: int, results: Mapping[str, RunResult], title: str) -> Figure:
    """Draw one figure.

    Args:
        number: of the figure among those of the scenario.
        results: runs that share it, by name.
        title: above it.
    """
    from matplotlib.figure import Figure

    spec = next(iter(results.values())).scenario.figures[number]
    panels: list[Shown] = [
        {run: (result.scenario.figures[number].plots[i], result) for run, result in results.items()}
        for i in range(len(spec.plots))
    ]
    rows = [panels[start : start + spec.columns] for start in range(0, len(panels), spec.columns)]
    heights: list[float] = []
    below = [spec.errors and any(_compared(panel) for panel in row) for row in rows]
    for row, errors in zip(rows, below, strict=True):
        tall = any(item.paths for panel in row for item, _ in panel.values())
        heights += [PATHS if tall else HEIGHT, ERRORS] if errors else [PATHS if tall else HEIGHT]
    size = (max(WIDTH * spec.columns, ALONE), sum(heights) + 0.7)
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.add_gridspec(len(heights), spec.columns, height_ratios=heights)
    place = 0
    for row, errors in zip(rows, below, strict=True):
        for column, panel in enumerate(row):
            found = errors and bool(_compared(panel))
            last = place + 1 if found or not errors else place + 2
            axis = figure.add_subplot(grid[place:last, column])
            _panel(axis, panel)
            if found:
                axis.tick_params(labelbottom=False)
                axis = figure.add_subplot(grid[place + 1, column], sharex=axis)
                _errors(axis, panel)
            axis.set_xlabel(axis.get_xlabel() or "time [s]")
        place += 2 if errors else 1
    _one_legend(figure)
    figure.suptitle(textwrap.fill(title, int(11.0 * size[0])))
    return figure


def _compared(panel: Shown) -> list[tuple[Axes, Comparison]]:
    """What the signals of axes are compared with."""
    return [
        (item, comparison)
        for item, result in panel.values()
        if not item.minus
        for signal in item.signals
        for comparison in result.comparisons.values()
        if comparison.signals == (signal,)
    ]


def _panel(axis: MatplotlibAxes, panel: Shown) -> None:
    for run, (item, result) in panel.items():
        shared = run if len(panel) > 1 else ""
        references = tuple(result.scenario.references.values())
        if item.paths:
            draw_paths(axis, item, result.recording, references, shared)
        elif item.comparisons:
            draw_comparisons(axis, item, result.comparisons, shared)
        else:
            draw_courses(axis, item, result.recording, references, shared)


def _errors(axis: MatplotlibAxes, panel: Shown) -> None:
    """What is simulated less what is measured."""
    for item, comparison in _compared(panel):
        shown = replace(
            item, label="error", signals=(), comparisons=("shown",), names=(), unit=item.error_unit
        )
        draw_comparisons(axis, shown, {"shown": comparison})
    if legend := axis.get_legend():
        legend.remove()


def _one_legend(figure: Figure) -> None:
    """One legend below where all axes that have one have the same."""
    having = [axis for axis in figure.axes if axis.get_legend() is not None]
    named = {tuple(axis.get_legend_handles_labels()[1]) for axis in having}
    if len(having) < 2 or len(named) != 1:
        return
    handles, labels = having[0].get_legend_handles_labels()
    for axis in having:
        legend = axis.get_legend()
        assert legend is not None
        legend.remove()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))


def figures(
    names: Sequence[str],
    provider: Provider,
    out: Path,
    *,
    suffix: str = "png",
    progress: Callable[[str, float], None] | None = None,
) -> list[Path]:
    """Make the figures that scenarios choose; each run that they need is run once.

    Args:
        names: scenarios, all that choose figures if empty.
        provider: where variants come from.
        out: folder for the pictures, `SCENARIO_FIGURE_RUN.png`.
        suffix: kind of the pictures.
        progress: told run and fraction now and then.

    Returns:
        The files.

    Raises:
        ScenarioError: a named scenario chooses no figure.
        CosimError: a run fails; see `run_scenario`.
    """
    if names:
        files = [scenarios.find(name)[0] for name in names]
    else:
        files = [file for file in scenarios.scenario_files() if "figures" in file.table]
    written: list[Path] = []
    for file in files:
        if not file.table.get("figures"):
            raise ScenarioError(
                f"{file.path}: chooses no figures; write [[figures]] with name and plots "
                "(docs/scenarios.md)"
            )
        written += _figures_of(file, provider, out, suffix, progress)
    return written


def _quantities(spec: FigureSpec, found: Mapping[str, RunResult]) -> list[ComparedQuantity]:
    """What the checks of runs measure, as far as the figure names it."""
    known = Result("", found).overview
    for name in spec.quantities:
        if name not in {item.name for item in known}:
            raise ScenarioError(
                f"figure {spec.name!r}: no check of these runs has the quantity {name!r}; "
                f"{listing([item.name for item in known], name)}"
            )
    return [item for item in known if item.name in spec.quantities]


def _figures_of(
    file: ScenarioFile,
    provider: Provider,
    out: Path,
    suffix: str,
    progress: Callable[[str, float], None] | None,
) -> list[Path]:
    known: dict[str, RunResult] = {}

    def result(run: str) -> RunResult:
        if run not in known:
            told: Any = (
                None if progress is None else (lambda part: progress(run or file.name, part))
            )
            known[run] = run_scenario(file.scenario(run), provider, progress=told)
        return known[run]

    written: list[Path] = []
    base = file.name.replace("/", "_")
    for number, spec in enumerate(file.scenario(next(iter(file.runs))).figures):
        runs = spec.runs or tuple(file.runs)
        parts = [runs] if spec.together else [(run,) for run in runs]
        for part in parts:
            found = {run: result(run) for run in part}
            if spec.quantities:
                path = out / f"{base}_{spec.name}.{suffix}"
                plot_overview(_quantities(spec, found), spec.title or file.text, path)
                written.append(path)
                continue
            own = found[part[0]].scenario.figures[number]
            title = own.title or " ".join([file.name, *(() if spec.together else part)]).strip()
            ending = "" if spec.together or not part[0] else f"_{part[0]}"
            path = out / f"{base}_{spec.name}{ending}.{suffix}"
            save(draw(number, found, title), path, DOTS)
            written.append(path)
    return written
