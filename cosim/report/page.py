"""The report of a diagnosis: one web page that works without a network.

First what a technician needs: the verdict in a sentence, what it means, what to do next, where in
the system, and a plot of before and after; then tables of everything.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..diagnose.story.facts import Facts
from ..diagnose.story.unexplained import likely_place
from ..diagnose.story.verdicts import Story, label, told
from ..display.document import document, links
from ..display.html import Html, join, tag, words
from ..drawing.svg import svg
from ..files import write_text
from . import optional, sections
from .figures import HEIGHT, Signals, all_signals, ordered, telling
from .material import Material, collected

if TYPE_CHECKING:
    from ..diagnose import Diagnosis

LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
LEAST_WIDTH, MOST_WIDTH = 0.62, 1.3
"""Of the drawing's own width, below which it scrolls instead of getting smaller; and above which
the box of a system of one part would fill the screen."""


def write_page(result: Diagnosis, path: Path) -> None:
    """Write the report.

    Raises:
        InputError: the file cannot be written.
    """
    write_text(path, page(result))


def page(result: Diagnosis) -> str:
    """The report as HTML."""
    return rendered(collected(result))


def rendered(material: Material) -> str:
    """The report of what was collected."""
    facts = Facts(material.table, {item.name: item.signal for item in material.channels})
    story = told(facts)
    chosen = telling(material, facts.worst, facts.purpose)
    signals = Signals(material, chosen.name if chosen is not None else "")
    runs = ordered(material.runs, chosen)
    details = [
        sections.findings(facts) if facts.verdict == "bad_data" else "",
        optional.hints(facts),
        optional.law(facts, signals.store),
        sections.effects(facts, material.symbols),
        sections.errors(facts, material),
        all_signals(material, signals, runs),
        sections.parameters(facts, material.symbols),
        sections.located(facts, signals.store),
        sections.candidates(material),
        sections.power(facts),
        sections.measured(facts, material),
        sections.findings(facts) if facts.verdict != "bad_data" else "",
        sections.glossary(material),
    ]
    first = tag(
        "div",
        tag("div", _cards(story, facts), class_="cards"),
        tag("section", _main_plot(material, signals, facts), _drawing(material, facts)),
        class_="first",
    )
    table = material.table
    about = (
        f"system {table['system']}, {len(runs)} runs, {table['evaluations']} simulated runs, "
        f"{table['wall_s']:.0f} s"
    )
    return document(
        f"{table['dataset']}: {story.label}",
        tag("header", tag("h1", f"Diagnosis of {table['dataset']}"), tag("small", about),
            class_="top"),
        tag("div", tag("div", story.label, class_="label"),
            tag("p", story.headline, class_="sentence"), class_=f"verdict {facts.verdict}"),
        first, links(details), *details, signals=signals.store,
    )  # fmt: skip


def _cards(story: Story, facts: Facts) -> Html:
    figures = _figures(facts)
    return join(
        tag("section", tag("h2", "What it means"), *(tag("p", p) for p in story.meaning), figures,
            class_="card"),
        tag("section", tag("h2", "What to do next"),
            tag("ol", *(tag("li", step) for step in story.steps)), class_="card"),
    )  # fmt: skip


def _figures(facts: Facts) -> Html:
    """The few numbers that say how good the models are."""
    worst = facts.worst
    if not worst:
        return Html("")
    shown = [("before", "before")] if not facts.effects else [("before", "before"),
                                                               ("after", "after")]  # fmt: skip
    items = [
        tag("div", tag("b", facts.ratio("channels", worst, which, facts.purpose)),
            tag("span", f"error of {worst} over noise" + (f", {name}" if len(shown) > 1 else ""),
                class_="what"))
        for which, name in shown
    ]  # fmt: skip
    for n, effect in enumerate(facts.effects[:1]):
        if effect["explained"] is not None:
            items.append(
                tag("div", tag("b", facts.percent("effects", n, "explained")),
                    tag("span", "of the excess over the noise explained", class_="what"))
            )  # fmt: skip
    return tag("div", *items, class_="figures")


def _marks(facts: Facts) -> tuple[dict[str, list[str]], list[tuple[str, Html]]]:
    """Badges by instance, and what they stand for."""
    entries: list[tuple[str, str, Html]] = []
    for n, effect in enumerate(facts.effects):
        entries.append(
            (str(n + 1), effect["component"], label(effect["effect"], effect["place"]))
        )  # fmt: skip
    for n, rival in enumerate(facts.rivals):
        for k, law in enumerate(rival):
            text = join("and " if k else "or ", label(law["effect"], law["place"]))
            entries.append((LETTERS[n % len(LETTERS)], law["place"].partition(".")[0], text))
    where = likely_place(facts) if facts.verdict == "unexplained" else None
    if where is not None:
        text = join("most likely place: ", tag("code", f"{where['component']}.{where['port']}"))
        entries.append(("?", where["component"], text))
    for name, channels in facts.faulty_instances().items():
        text = join("faulty, measured there: ", words([tag("b", c) for c in channels]))
        entries.append(("!", name, text))
    marks: dict[str, list[str]] = {}
    for mark, instance, _ in entries:
        marks.setdefault(instance, []).append(mark)
    return marks, [(mark, text) for mark, _, text in entries]


def _drawing(material: Material, facts: Facts) -> Html:
    """The system with the place marked."""
    if material.system is None:
        return Html("")
    marks, legend = _marks(facts)
    drawn = svg(material.system, marks)
    width = float(drawn.partition('width="')[2].partition('"')[0])
    return join(
        tag("h2", "Where in the system"),
        tag("div", Html(drawn), class_="drawing", tabindex="0",
            style=f"--least:{LEAST_WIDTH * width:.0f}px;--most:{MOST_WIDTH * width:.0f}px"),
        tag("ul", *(tag("li", tag("b", mark), text) for mark, text in legend), class_="legend")
        if legend else tag("p", "Boxes are parts of the model, lines are what they exchange.",
                           class_="note"),
    )  # fmt: skip


def _main_plot(material: Material, signals: Signals, facts: Facts) -> Html:
    """Measured and modelled, and what is left, where it tells most."""
    names = [channel.name for channel in material.channels]
    faulty = [(name, f["run"]) for f in facts.errors for name in facts.concerned(f)]
    chosen = telling(material, facts.worst, facts.purpose)
    if facts.worst:
        shown = [facts.worst]
    elif faulty:
        shown = list(dict.fromkeys(name for name, _ in faulty))[:2]
        chosen = next((run for run in material.runs if run.name == faulty[0][1]), chosen)
    else:
        shown = names[:1]
    if not shown or chosen is None:
        return Html("")
    what = (
        "Before → after" if facts.effects else "Measured and modelled" if facts.worst
        else "Measured"
    )  # fmt: skip
    runs = ordered(material.runs, chosen)
    return join(
        tag("h2", f"{what}: {' and '.join(shown)}"),
        tag("p", "Drag to zoom, double-click to see all, hover or tap to read values.",
            class_="note hint"),
        *(signals.shown(names.index(name), runs, "first", HEIGHT // len(shown)) for name in shown),
    )  # fmt: skip
