"""Pictures of runs: axes that a scenario describes, and the overview of all its runs."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..data.comparison import Comparison, Reference, convert_reference, within
from ..data.recording import Recording
from ..display.literal import literal
from ..errors import UnknownNameError
from ..files import atomic
from ..scenario.axes import Axes
from ..spec.units import Unit, change
from .comparison_table import ComparedQuantity

if TYPE_CHECKING:
    from matplotlib.axes import Axes as MatplotlibAxes
    from matplotlib.figure import Figure

Vector = NDArray[np.float64]
MEASURED = {"color": "black", "linewidth": 2.2, "alpha": 0.55}
"""How references are drawn: below the model's thin coloured lines."""
PATH_HEIGHT = 4.2
"""Height of the axes of paths [inch]."""
SPREAD = 100.0
"""Ratio of largest to smallest value of an overview from which its scale is logarithmic."""
_LINES = ("-", "--", "-.", ":")
_MARKERS = ("o", "s", "^", "D", "v", "x")


# -- one run ---------------------------------------------------------------------------------------


def plot_run(
    recording: Recording,
    axes: Sequence[Axes],
    references: Mapping[str, Reference],
    comparisons: Mapping[str, Comparison],
    title: str,
    path: Path | str | None = None,
) -> Figure:
    """Draw the axes that a scenario describes: paths on the left, signals over time on the right.

    Signals that a swapped variant does not have are left out.

    Args:
        recording: of the run.
        axes: what to draw.
        references, comparisons: by name.
        title: of the figure.
        path: where to write it; the suffix says how.
    """
    from matplotlib.figure import Figure

    paths = [item for item in axes if item.paths]
    courses = [item for item in axes if not item.paths]
    width = 5.0 * bool(paths) + 8.0 * bool(courses)
    height = max(2.2 * len(courses), PATH_HEIGHT * len(paths)) + 0.6
    figure = Figure(figsize=(width, height), layout="constrained")
    columns: Any = (figure, figure)
    if paths and courses:
        columns = figure.subfigures(1, 2, width_ratios=(5.0, 8.0))
    if paths:
        for axis, item in zip(_path_column(columns[0], len(paths), height), paths, strict=True):
            draw_paths(axis, item, recording, tuple(references.values()))
    if courses:
        found = _column(columns[1], len(courses), len({(i.after, i.before) for i in courses}) == 1)
        for axis, item in zip(found, courses, strict=True):
            if item.comparisons:
                draw_comparisons(axis, item, comparisons)
            else:
                draw_courses(axis, item, recording, tuple(references.values()))
        found[-1].set_xlabel("time [s]")
    figure.suptitle(title + (f" (stopped: {recording.error[:80]})" if recording.error else ""))
    save(figure, path)
    return figure


def _column(place: Any, count: int, shared: bool) -> list[MatplotlibAxes]:
    return list(place.subplots(count, 1, sharex=shared, squeeze=False)[:, 0])


def _path_column(place: Any, count: int, height: float) -> list[MatplotlibAxes]:
    """Axes below each other, none much higher than wide; room that is left [inch] stays empty."""
    rest = height - PATH_HEIGHT * count
    if rest < 1.0:
        return _column(place, count, False)
    ratios = [PATH_HEIGHT] * count + [rest]
    axes: list[MatplotlibAxes]
    *axes, empty = place.subplots(count + 1, 1, height_ratios=ratios)
    empty.remove()
    return axes


def save(figure: Figure, path: Path | str | None, dots: int = 120) -> None:
    """Write a picture, `dots` per inch; the suffix says how."""
    literal(figure)
    if path is not None:
        with atomic(Path(path)) as temporary:
            figure.savefig(temporary, dpi=dots)


class _Scale:
    """Into the unit that an axes shows; of differences, which have no offset."""

    def __init__(self, own: Unit | None, shown: str, difference: bool) -> None:
        self.gain, self.offset = (
            change(shown, own, back=True, difference=difference)
            if own is not None and shown
            else (1.0, 0.0)
        )

    def __call__(self, values: Vector) -> Vector:
        return values * self.gain + self.offset


def _scale(recording: Recording, item: Axes, name: str) -> _Scale:
    """The one of a signal of axes."""
    difference = bool(item.minus) or name in recording.relative
    return _Scale(recording.unit(name) if item.unit else None, item.unit, difference)


def _label(text: str, unit: str) -> str:
    return f"{text} [{unit}]".strip() if unit else text


def _window(item: Axes, times: Vector) -> NDArray[np.bool_]:
    return within(times, item.after, item.before)


def _compared(references: Sequence[Reference], signals: tuple[str, ...]) -> list[Reference]:
    """What signals are compared with."""
    return [item for item in references if item.signals == signals]


def _labels(axis: MatplotlibAxes) -> list[str]:
    return list(axis.get_legend_handles_labels()[1])


def _finish(axis: MatplotlibAxes, *, beside: bool) -> None:
    axis.grid(True, alpha=0.3)
    count = len(axis.get_legend_handles_labels()[0])
    if 0 < count <= 12 and beside:
        axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize="small")
    elif 0 < count <= 12:
        axis.legend(loc="best", fontsize="small")


def draw_paths(
    axis: MatplotlibAxes,
    item: Axes,
    recording: Recording,
    references: Sequence[Reference],
    run: str = "",
) -> None:
    """Draw paths over what they are compared with.

    Args:
        axis: where.
        item: what.
        recording, references: of the run.
        run: name of the run, where several share the axes.
    """
    inside = _window(item, recording.time)
    unit, seen = "", set()
    for pair in item.paths:
        for reference in _compared(references, pair):
            if reference.text in seen:
                continue
            scale = _scale(recording, item, pair[0])
            seen.add(reference.text)
            points = scale(convert_reference(recording, reference))[_window(item, reference.times)]
            text = reference.text if reference.text not in _labels(axis) else None
            axis.plot(points[:, 0], points[:, 1], label=text, **MEASURED)  # type: ignore[arg-type]
            axis.plot(points[-1:, 0], points[-1:, 1], "o", color="black", markersize=6)
    for number, pair in enumerate(item.paths):
        scale = _scale(recording, item, pair[0])
        unit = item.unit or recording.units.get(pair[0], "")
        x, y = (scale(recording[name])[inside] for name in pair)
        name = item.names[number] if item.names else ", ".join(pair)
        name = f"{run} {name}".strip() if len(item.paths) > 1 or not run else run
        several = bool(run) and not _compared(references, pair)  # they may cover each other
        style = _LINES[(len(_labels(axis)) if several else number) % 4]
        (line,) = axis.plot(x, y, style, linewidth=1.2, label=name)
        axis.plot(x[-1:], y[-1:], "o", color=line.get_color(), markersize=4)  # where it ends
    axis.set_aspect("equal", adjustable="datalim")
    axis.set_xlabel(_label("x", unit))
    axis.set_ylabel(_label("y", unit))
    axis.set_title(item.label, fontsize="medium")
    _finish(axis, beside=False)


def draw_courses(
    axis: MatplotlibAxes,
    item: Axes,
    recording: Recording,
    references: Sequence[Reference],
    run: str = "",
) -> None:
    """Draw signals over time and over what they are compared with; arguments as of `draw_paths`."""
    inside = _window(item, recording.time)
    unit, line = item.unit, 0
    for number, signal in enumerate(item.signals):
        try:
            names = [recording.names[column] for column in recording.find(signal)]
        except UnknownNameError:
            continue
        for element in names:
            scale = _scale(recording, item, element)
            unit = item.unit or recording.units.get(element, "")
            for reference in [] if item.minus else _compared(references, (element,)):
                drawn = _window(item, reference.times)
                values = scale(convert_reference(recording, reference)[:, 0])
                text = reference.text if reference.text not in _labels(axis) else None
                axis.plot(
                    reference.times[drawn], values[drawn], label=text, **MEASURED  # type: ignore[arg-type]
                )  # fmt: skip
            course = recording[element]
            if item.minus:
                course = course - recording.like(item.minus, element)
            name = item.names[number] if item.names else signal
            name += element[len(signal) :] if len(names) > 1 else ""
            name = f"{run} {name}".strip()
            axis.plot(
                recording.time[inside],
                scale(course)[inside],
                _LINES[line // 10 % 4],
                linewidth=1.1,
                label=name,
            )
            line += 1
    axis.set_ylabel(_label(item.label, unit))
    axis.margins(x=0.01)
    _finish(axis, beside=True)


def draw_comparisons(
    axis: MatplotlibAxes, item: Axes, comparisons: Mapping[str, Comparison], run: str = ""
) -> None:
    """Draw how far signals are from what they are compared with; `run` as of `draw_paths`."""
    unit = item.unit
    for number, name in enumerate(item.comparisons):
        found = comparisons[name]
        scale = _Scale(found.definition, item.unit, True)
        unit = item.unit or found.unit
        inside = _window(item, found.times)
        axis.plot(
            found.times[inside],
            scale(found.differences)[inside],
            linewidth=1.1,
            label=f"{run} {item.names[number] if item.names else name}".strip(),
        )
    axis.set_ylabel(_label(item.label, unit))
    axis.margins(x=0.01)
    _finish(axis, beside=True)


# -- all runs --------------------------------------------------------------------------------------


def plot_overview(
    quantities: Sequence[ComparedQuantity], title: str, path: Path | str | None = None
) -> Figure:
    """Draw one axes per quantity: expected values (or limits) and those of each case over runs."""
    from matplotlib.figure import Figure

    runs = list(dict.fromkeys(run for item in quantities for run in item.runs))
    place = {run: index for index, run in enumerate(runs)}
    figure = Figure(
        figsize=(max(7.0, 2.5 + 0.45 * len(runs)), 0.9 + 2.6 * len(quantities)),
        layout="constrained",
    )
    for axis, item in zip(_column(figure, len(quantities), True), quantities, strict=True):
        known = [run for run in item.runs if run in item.marks]
        if known:
            axis.errorbar(
                [place[run] for run in known],
                [item.marks[run] for run in known],
                xerr=0.42, fmt="none", ecolor="black", elinewidth=2.2, alpha=0.7,
                label=item.reference,
            )  # fmt: skip
        width = 0.18 if len(item.cases) > 1 else 0.0
        for number, case in enumerate(item.cases):
            found = {run: item.values[case, run] for run in item.runs if (case, run) in item.values}
            axis.plot(
                [place[run] + width * (number - (len(item.cases) - 1) / 2) for run in found],
                list(found.values()),
                _MARKERS[number % len(_MARKERS)],
                markersize=5,
                label=case or "simulated",
            )
        axis.set_title(item.name, loc="left", fontsize="medium")
        axis.set_ylabel(_label("", item.unit if item.unit != "1" else ""))
        shown = [*item.values.values(), *item.marks.values()]
        if min(shown) > 0.0 and max(shown) > SPREAD * min(shown):
            axis.set_yscale("log")
        elif min(shown) >= 0.0 and max(shown) > 0.0:
            axis.set_ylim(0.0, 1.08 * max(shown))
        axis.set_xticks(range(len(runs)), runs, rotation=45, ha="right", fontsize="small")
        axis.tick_params(labelbottom=item is quantities[-1])
        axis.grid(True, axis="y", alpha=0.3)
        axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize="small")
    figure.suptitle(textwrap.fill(title, int(9.0 * figure.get_figwidth())))
    save(figure, path)
    return figure
