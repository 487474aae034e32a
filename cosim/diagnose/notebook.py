"""How a diagnosis shows itself in a notebook."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..calibrate.problem import Problem
from ..display.chart import COLOURS, Line, lines
from ..display.html import Html, table, tag, unit
from ..display.notebook import view
from .story.facts import Facts
from .story.verdicts import told

Residuals = Mapping[tuple[str, str], NDArray[np.float64]]


def shown(content: Mapping[str, Any], problem: Problem, residuals: Residuals) -> str:
    """Verdict, meaning, next steps, errors, and the residual of the channel that is missed most.

    Args:
        content: as of `cosim diagnose --json`.
        problem: that was diagnosed.
        residuals: (`before`/`after`, run) -> residuals over sigma.
    """
    facts = Facts(content)
    story = told(facts)
    kinds = ("before", "after") if facts.effects else ("before",)
    rows: list[list[object]] = [
        [name, unit(row["unit"]),
         *(facts.error_cell("channels", name, which, facts.purpose) for which in kinds)]
        for name, row in facts.at("channels").items()
        if row["before"][facts.purpose] is not None
    ]  # fmt: skip
    head = ["channel", "unit", *(f"error {which} (over noise)" for which in kinds)]
    return view(
        story.label, f"data set {facts.at('dataset')}, system {facts.at('system')}",
        tag("p", tag("b", story.headline)),
        *(tag("p", text) for text in story.meaning),
        _residual(problem, residuals, facts),
        table(head, rows) if rows else "",
        tag("p", tag("b", "What to do next")),
        tag("ol", *(tag("li", step) for step in story.steps)),
    )  # fmt: skip


def _residual(problem: Problem, residuals: Residuals, facts: Facts) -> Html:
    """Residuals of the worst channel, in the run in which it is largest."""
    runs = {run.name: run for run in problem.runs}
    names = [channel.name for channel in problem.channels]
    if not facts.worst or facts.worst not in names:
        return Html("")
    column = names.index(facts.worst)
    channel = problem.channels[column]
    sizes = {
        run: float(np.nansum(values[:, column] ** 2))
        for (which, run), values in residuals.items()
        if which == "before" and runs[run].purpose == facts.purpose
    }
    name = max(sizes, key=lambda run: sizes[run])
    items = [
        Line(which, runs[name].times, residuals[which, name][:, column] * channel.sigma,
             colour)
        for which, colour in (("before", COLOURS[1]), ("after", COLOURS[0]))
        if which == "before" or facts.effects
    ]  # fmt: skip
    of = f" [{unit(channel.unit)}]" if unit(channel.unit) else ""
    title = f"{channel.name} in run {name}: measured − model{of}; band: ± 2 × noise"
    return lines(items, title=title, band=2.0 * channel.sigma)
