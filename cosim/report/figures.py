"""The plots of a report: what was measured and modelled, and the residual below."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..display.document import section
from ..display.html import Html, tag, unit
from ..display.plot import Curve, Panel, plot
from ..display.series import PER_VALUE, Store, stretch
from .material import Material, ShownRun

ROOM = 1_300_000
"""Characters that the signals of a report may take."""
WHOLE = 0.45
"""Part of them that the run which is shown first may take with every sample."""
HEIGHT = 210
"""Of the first plot's upper panel [px]."""
OPEN = 4
"""Channels whose plots are open from the start."""
KINDS = ("before", "after")


class Signals:
    """The signals of a report, every sample of the run that tells most, others thinned if need be.

    Args:
        material: of the report.
        first: run that is shown first.
    """

    def __init__(self, material: Material, first: str) -> None:
        self.store = Store()
        self.thinned: dict[str, int] = {}
        self.material = material
        room = float(ROOM)
        main = [run for run in material.runs if run.name == first]
        for run in main:
            if self._count(run, 1) * PER_VALUE <= WHOLE * ROOM:
                self._put(run, 1)
                room -= self._count(run, 1) * PER_VALUE
            else:
                main = []
        others = [run for run in material.runs if run not in main]
        plain = sum(self._count(run, 1) for run in others) * PER_VALUE <= room
        samples = sum(self._count(run, 2) for run in others)
        for run in others:
            size = 1 if plain else stretch(samples, room, run.times.size)
            self._put(run, size)
            if size > 1:
                self.thinned[run.name] = size

    @staticmethod
    def _count(run: ShownRun, size: int) -> int:
        """Numbers that a run takes; where it is thinned, what models say has to be told, too."""
        return run.data.size * (1 + len(run.residuals) * (1 if size == 1 else 2))

    def _put(self, run: ShownRun, size: int) -> None:
        self.store.put_axis(f"{run.name}/time", run.times, size)
        for column, channel in enumerate(self.material.channels):
            name = f"{run.name}/{channel.name}"
            data = run.data[:, column]
            self.store.put(f"{name}/measured", data, size)
            for kind, values in run.residuals.items():
                rest = values[:, column] * channel.sigma
                self.store.put(f"{name}/{kind}/rest", rest, size)
                if size > 1:
                    self.store.put(f"{name}/{kind}", data - rest, size)

    def panels(self, column: int, height: int = 170) -> list[Panel]:
        """Measured and modelled values of a channel, and below what is left."""
        channel = self.material.channels[column]
        kinds = [k for k in KINDS if any(k in run.residuals for run in self.material.runs)]
        time, name = "{run}/time", "{run}/" + channel.name
        of = f" [{unit(channel.unit)}]" if unit(channel.unit) else ""
        titles = model_names(kinds)
        measured = Curve("measured", "measured", time, f"{name}/measured", width=2.2, fill=0.45)
        models = [
            Curve(titles[k], k, time, f"{name}/{k}",
                  (f"{name}/measured", f"{name}/{k}/rest"), fill=0.9)
            for k in kinds
        ]  # fmt: skip
        found = [Panel(channel.name + of, [measured, *models], None, height, channel.name)]
        if kinds:
            rests = [Curve(titles[k], k, time, f"{name}/{k}/rest", width=1.0) for k in kinds]
            found.append(
                Panel(f"measured − model{of}; band: ± 2 × noise", rests, 2.0 * channel.sigma,
                      round(0.6 * height), "rest")
            )  # fmt: skip
        return found

    def shown(self, column: int, runs: Sequence[ShownRun], group: str, height: int = 170) -> Html:
        """The plot of a channel with a choice of runs."""
        channel = self.material.channels[column]
        names = {run.name: f"run {run.name} ({used(run.purpose)})" for run in runs}
        return plot(
            f"{channel.name}: measured, modelled and what is left", self.panels(column, height),
            axis="time [s]", cursor="time", group=group, runs=names,
        )  # fmt: skip


def model_names(kinds: Sequence[str]) -> dict[str, str]:
    """How the models are called in a plot."""
    if len(kinds) > 1:
        return {"before": "model before", "after": "model after"}
    return dict.fromkeys(kinds, "model")


def used(purpose: str) -> str:
    """What a run was used for, in a word."""
    return {"identification": "fitted", "validation": "unused"}.get(purpose, purpose)


def telling(material: Material, worst: str, purpose: str) -> ShownRun | None:
    """The run that the declared model describes worst in a channel, None without runs."""
    names = [channel.name for channel in material.channels]
    column = names.index(worst) if worst in names else 0
    runs = [run for run in material.runs if run.purpose == purpose] or list(material.runs)
    return max(runs, key=lambda run: run.excess(column), default=None)


def ordered(runs: Sequence[ShownRun], first: ShownRun | None) -> list[ShownRun]:
    """The runs with one of them first."""
    return [run for run in runs if run is first] + [run for run in runs if run is not first]


def unknown_curve(store: Store, name: str, place: str, of: str, curve: Mapping[str, Any]) -> Html:
    """What enters at a place against what drives it, with twice its standard deviation."""
    at, value = np.array(curve["at"]), np.array(curve["value"])
    edge = 2.0 * np.array(curve["deviation"])
    store.put_axis(f"{name}/at", at)
    store.put(f"{name}/value", value)
    store.put(f"{name}/edge", value - edge)
    store.put(f"{name}/edge^", value + edge)
    shown = f" [{unit(of)}]" if unit(of) else ""
    against = curve["driver"].replace("_", " ") + (
        f" of run {curve['run']}" if curve["run"] else ""
    )
    return plot(
        f"unknown input at {place} against {against}",
        [
            Panel(
                f"unknown input at {place}{shown}",
                [
                    Curve("± 2 σ", "measured", f"{name}/at", f"{name}/edge", fill=0.3),
                    Curve("unknown input", "after", f"{name}/at", f"{name}/value", dots=True),
                ],
                short="u",
            )
        ],
        axis=against + (" [s]" if curve["driver"] == "time" else ""), group=name,
    )  # fmt: skip


def by_excess(material: Material) -> list[int]:
    """Channels, those that the declared model misses most first."""

    def size(column: int) -> float:
        return max((run.excess(column) for run in material.runs), default=0.0)

    return sorted(range(len(material.channels)), key=lambda column: -size(column))


def all_signals(material: Material, signals: Signals, runs: Sequence[ShownRun]) -> Html:
    """Plots of all channels with a choice of runs."""
    if not runs:
        return Html("")
    plots = [signals.shown(column, runs, "all") for column in by_excess(material)]
    rest = plots[OPEN:]
    sizes = sorted(set(signals.thinned.values()))
    thinned = " to ".join(str(size) for size in dict.fromkeys(sizes[:1] + sizes[-1:]))
    how = (
        f"Of some runs, {thinned} samples are drawn as one bar from the smallest to the largest, "
        "so that no peak is lost."
        if thinned
        else "Every sample is drawn."
    )
    modelled = any(run.residuals for run in material.runs)
    return section(
        "signals",
        "All signals",
        tag(
            "p",
            "Measured and modelled values, below them what is left. "
            if modelled
            else "Measured values; nothing was simulated. ",
            f"All plots follow the one that is zoomed. {how}",
        ),
        tag("div", *plots[:OPEN], class_="grid"),
        tag(
            "details",
            tag("summary", f"{len(rest)} more channels"),
            tag("div", *rest, class_="grid"),
        )
        if rest
        else "",
    )
