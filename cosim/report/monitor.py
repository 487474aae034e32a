"""The page of a monitored series: what changed, since when, and control charts."""

from __future__ import annotations

from pathlib import Path

from ..display.control_chart import control_chart
from ..display.document import document, links, section
from ..display.html import Cell, Html, command, explained, join, number, table, tag, unit
from ..files import write_text
from ..monitor import Monitored
from ..monitor.change import Change
from ..monitor.result import VERDICTS, Chart

TONES = {
    "nothing_changed": "nothing_missing",
    "changed": "confounded",
    "unexplained": "unexplained",
}
"""Classes of the style sheet."""
KINDS = {"step": "jump", "creep": "creep", "outlier": "one log", "spell": "for a while"}


def write_monitor_page(result: Monitored, path: Path) -> None:
    """Write the page.

    Raises:
        InputError: the file cannot be written.
    """
    write_text(path, monitor_page(result))


def monitor_page(result: Monitored) -> str:
    """The page as HTML."""
    logs, verdict = result.series.logs, result.verdict
    charts = result.charts()
    calm = [chart for chart in charts if not _told(result, chart)]
    loud = [chart for chart in charts if _told(result, chart)]
    details = [
        _changes(result),
        section("charts", "Control charts", _guide(result), _grid(result, loud),
                _rest(result, calm, bool(loud))),
        _logs(result),
    ]  # fmt: skip
    about = (
        f"system {result.series.problem.file.name}, {len(logs)} logs, "
        f"{result.patterns.evaluations} simulated runs, {result.wall:.0f} s"
    )
    first = tag("div", _meaning(result), _next(result), class_="cards")
    return document(
        f"{result.series.name}: {VERDICTS[verdict]}",
        tag("header", tag("h1", f"Logs of {result.series.name}"), tag("small", about),
            class_="top"),
        tag("div", tag("div", VERDICTS[verdict], class_="label"),
            tag("p", _headline(result), class_="sentence"), class_=f"verdict {TONES[verdict]}"),
        first, links(details), *details,
    )  # fmt: skip


def _headline(result: Monitored) -> str:
    span = result.span
    if not result.changes:
        return f"In {span} nothing has changed beyond what differs from log to log."
    dates = dict.fromkeys(result.dated(c.profile.first) for c in result.changes)
    count = len(result.changes)
    what = "one change" if count == 1 else f"{count} changes"
    return f"In {span} there is {what}: since {', '.join(dates)}." if count == 1 else (
        f"In {span} there are {what}: since {', '.join(dates)}."
    )  # fmt: skip


def _meaning(result: Monitored) -> Html:
    """The changes in words, and what the verdict rests on."""
    items = [tag("li", result.sentence(change)) for change in result.changes]
    rests = (
        f"Of series in which nothing changes, {result.rate:g} would alarm: {result.found.tests} "
        "tests share that, a third of it those of what passes, and a third all pairs of changes. "
        "It holds for logs that are independent of each other."
    )
    return tag(
        "section", tag("h2", "What it means"), tag("ul", *items) if items else "",
        tag("p", rests), *(tag("p", tag("b", "Mind: "), text) for text in result.warnings),
        class_="card",
    )  # fmt: skip


def _next(result: Monitored) -> Html:
    """What to do."""
    steps: list[Html] = []
    for change in result.changes:
        day = result.dated(change.profile.first)
        if change.profile.kind == "outlier":
            steps.append(join("Look at what was special about the log of ", tag("b", day), "."))
        elif change.profile.kind == "step":
            steps.append(
                join("Look up what was done to the machine before ", tag("b", day), ".")
            )  # fmt: skip
        elif change.profile.kind == "spell":
            until = tag("b", result.dated(change.profile.last or 0))
            steps.append(join("Look up what was done to the machine before ", tag("b", day),
                              " and undone before ", until, "."))  # fmt: skip
        else:
            steps.append(join("Look for wear that began about ", tag("b", day), "."))
    steps = list(dict.fromkeys(steps))
    if result.changes:
        steps.append(
            join("Confirm the name by a diagnosis of logs in which it is so:",
                 command("cosim diagnose FOLDER_WITH_THESE_LOGS"))
        )  # fmt: skip
    else:
        steps.append(join("Go on; run this again when there are more logs."))
    body = tag("ol", *(tag("li", step) for step in steps))
    return tag("section", tag("h2", "What to do next"), body, class_="card")


def _changes(result: Monitored) -> Html:
    """The changes as a table."""
    rows = []
    for change in result.changes:
        entry = result.entry(change)
        named = entry["what"] if entry["named"] else f"unexplained ({entry['what']})"
        if change.direction is None:
            named = f"unexplained, left of {change.channel}"
            size, interval = f"× {entry['factor']:.3g}", ""
        else:
            low, high = entry["ci95"]
            size, interval = f"{entry['change']:+.4g}", f"{low:+.4g} to {high:+.4g}"
        rows.append(
            [explained(named, entry["text"]), KINDS[entry["kind"]],
             Cell(entry["since"] + (f" until {entry['until']}" if entry["until"] else "")),
             Cell(" to ".join(entry["between"]) if entry["kind"] != "outlier" else "–"),
             Cell(size), Cell(interval), unit(entry["unit"]),
             Cell(", ".join([*entry["cannot_tell_from"], *entry.get("same", [])]) or "–", None,
                  "text")]
        )  # fmt: skip
    head = [
        "what", "how", "since", ("between", "95 % interval of the date."),
        ("size", "At the end of the series, in that log, or in between."),
        ("95 % interval", "Of the size."),
        "unit", ("not told from", "Names that explain the logs as well."),
    ]  # fmt: skip
    return section("changes", "Changes", table(head, rows, "changes"))


def _concerns(change: Change, chart: Chart) -> bool:
    if change.direction is None:
        return chart.name == f"left of {change.channel}"
    return chart.name == change.direction.name


def _told(result: Monitored, chart: Chart) -> bool:
    """Whether a chart shows something."""
    return bool(chart.outside) or any(_concerns(c, chart) for c in result.changes)


def _guide(result: Monitored) -> Html:
    return tag(
        "p",
        "One point per log: its own estimate, all declared parameters fitted together, and other "
        "changes that were found taken off. Hollow: the "
        f"first {result.baseline} logs, from whose scatter the limits (green) come. Orange points "
        "are beyond them, orange lines are the changes found. What is left of a channel is the "
        "RMS of measured less modelled, over the noise, with nothing taken off: the model of the "
        "first logs with each log's own parameters.",
        class_="note",
    )


def _grid(result: Monitored, charts: list[Chart]) -> Html:
    dates = [log.date for log in result.series.logs]
    changes = [(c.profile.first, result.sentence(c)) for c in result.changes]
    drawn = []
    for chart in charts:
        of = f" [{unit(chart.unit)}]" if unit(chart.unit) else ""
        drawn.append(
            control_chart(
                chart.name + of, dates, chart.values, chart.deviations,
                (chart.centre, chart.low, chart.high), baseline=result.baseline, changes=changes,
                outside=chart.outside,
            )
        )  # fmt: skip
    return tag("div", *drawn, class_="grid") if drawn else Html("")


def _rest(result: Monitored, charts: list[Chart], folded: bool) -> Html:
    """Charts on which nothing is to be seen."""
    if not folded:
        return _grid(result, charts)
    if not charts:
        return Html("")
    title = f"{len(charts)} more, all within their limits"
    return tag("details", tag("summary", title), _grid(result, charts))


def _logs(result: Monitored) -> Html:
    """The logs as a table."""
    charts = result.parameter_charts()
    rows = [
        [log.name, Cell(result.dated(k)), len(log.runs),
         *(Cell(number(float(c.values[k])), float(c.values[k]), "over" if k in c.outside else "")
           for c in charts)]
        for k, log in enumerate(result.series.logs)
    ]  # fmt: skip
    names = [f"{c.name} [{unit(c.unit)}]" if unit(c.unit) else c.name for c in charts]
    head = ["log", "date", "runs", *names]
    body = table(head, rows, "logs")
    return section(
        "logs", "Logs", tag("p", f"Dated by the {result.series.dated}."),
        tag("details", tag("summary", f"{len(rows)} logs with their own parameters"), body),
    )  # fmt: skip
