"""The report of a diagnosis: one web page that works without a network."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..diagnose.bursts import written
from ..files import write_text
from .chart import COLOURS, Line, lines

if TYPE_CHECKING:
    from ..diagnose import Diagnosis
    from ..diagnose.localise import Curve

PLACES, CURVES = 8, 2
"""Places that are listed, and those whose curves are drawn."""

HEADLINES = {
    "effect_found": "Something is missing in the model, and it has a name",
    "nothing_missing": "Nothing is missing",
    "confounded": "Something is missing, but the data fit more than one explanation",
    "unexplained": "Something is missing that the catalogue does not hold",
    "bad_data": "The data cannot be used",
}
STYLE = """
body{font:15px/1.5 system-ui,sans-serif;color:#1f2937;max-width:1080px;margin:2em auto;
padding:0 1em}
h1{font-size:1.6em;margin:0}h2{margin-top:2em;border-bottom:1px solid #ddd;font-size:1.2em}
.verdict{border-left:6px solid #0b6fb8;background:#f0f7fd;padding:.8em 1.2em;margin:1em 0}
.verdict.nothing_missing{border-color:#15803d;background:#f0fdf4}
.verdict.unexplained,.verdict.bad_data{border-color:#c2410c;background:#fff7ed}
table{border-collapse:collapse;margin:.6em 0}
th,td{padding:.2em .8em;border-bottom:1px solid #e5e7eb;
text-align:right;white-space:nowrap}th:first-child,td:first-child{text-align:left}
th{background:#f9fafb}td.text{text-align:left;white-space:normal}
.over{color:#c2410c;font-weight:600}
.good{color:#15803d}.grid{display:grid;grid-template-columns:1fr 1fr;gap:.5em}
svg{width:100%;height:auto;font:11px system-ui,sans-serif;fill:#374151}svg .title{font-weight:600}
small,.note{color:#6b7280}.wide{overflow-x:auto}@media(max-width:800px){.grid{grid-template-columns:1fr}}
"""


def write_page(result: Diagnosis, path: Path) -> None:
    """Write the report."""
    write_text(path, page(result))


def page(result: Diagnosis) -> str:
    """The report as HTML."""
    table = result.to_dict()
    name = escape(result.problem.name)
    parts = [
        "<!doctype html><html lang='en'><head><meta charset='utf-8'>",
        "<meta name='viewport' content='width=device-width'>",
        f"<title>{name}: {result.verdict}</title><style>{STYLE}</style></head><body>",
        f"<h1>{name}</h1><small>system {escape(str(table['system']))}, {len(result.problem.runs)} "
        f"runs, {table['evaluations']} simulated runs, {table['wall_s']:.0f} s</small>",
        f"<div class='verdict {result.verdict}'><b>{HEADLINES.get(result.verdict, '')}</b><br>"
        f"{escape(result.reason)}</div>",
        *(f"<p class='over'>{escape(text)}</p>" for text in result.warnings),
        _effects(table["effects"]),
        _hints(table["hints"]),
        _errors(result, table),
        _further(table["further_runs"]),
        _parameters(table["parameters"]),
        _starts(table["start_values"]),
        _ended(table["unstable_from"]),
        _bursts(table["bursts"]),
        _measured(result),
        _residuals(result),
        _located(result),
        _candidates(result),
        _next(table),
        _power(table["power"]),
        "</body></html>",
    ]
    return "\n".join(part for part in parts if part)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    body = "".join("<tr>" + "".join(cells) + "</tr>" for cells in rows)
    if not body:
        return ""
    titles = "".join(f"<th>{escape(h)}</th>" for h in head)
    return f"<div class='wide'><table><tr>{titles}</tr>{body}</table></div>"


def _td(text: str, kind: str = "") -> str:
    return f"<td class='{kind}'>{escape(text)}</td>" if kind else f"<td>{escape(text)}</td>"


def _number(value: float | None) -> str:
    return "–" if value is None or not np.isfinite(value) else f"{value:.4g}"


def _interval(entry: dict[str, Any]) -> str:
    """Both ends, and "open" if the data say no more than the bounds."""
    low, high = entry["ci95"]
    return f"{_number(low)} to {_number(high)}{'' if entry['identifiable'] else ', open'}"


def _effects(effects: list[dict[str, Any]]) -> str:
    parts = []
    for item in effects:
        places = ", ".join(item["other_places"])
        where = (
            f"<p class='note'>The data do not tell it from: {escape(places)}.</p>" if places else ""
        )
        share = item["explained"]
        rows = [
            [_td(name), _td(_number(v["value"])),
             _td(_interval(v)), _td(v["unit"])]
            for name, v in item["parameters"].items()
        ]  # fmt: skip
        parts.append(
            f"<h3>{escape(item['effect'])} at {escape(item['place'])}</h3>"
            f"<p>{escape(item['text'])} "
            + (f"It explains {100 * share:.1f} % of what the residual held beyond noise; " if share
               is not None else "")
            + f"on unused runs the log likelihood rises by {_number(item['validation_gain_nats'])}."
            f"</p>{_table(['parameter', 'value', '95 % interval', 'unit'], rows)}{where}"
        )  # fmt: skip
    return "<h2>What was found</h2>" + "".join(parts) if parts else ""


def _hints(hints: list[dict[str, Any]]) -> str:
    """Nearest laws of an unexplained residual: what they would take, and why they are no names."""
    rows = []
    for item in hints:
        laws = [
            f"{law['effect']} at {law['place']}: "
            + ", ".join(
                f"{name} = {_number(v['value'])} ({_interval(v)}) {v['unit']}"
                for name, v in law["parameters"].items()
            )
            for law in item["effects"]
        ]
        left = item["left"]
        stays = f"{left['channel']} {left['times_noise']:.3g}×" if left else "–"
        share = f"{100 * item['explained']:.3g} %" + (" *" if item["first_order"] else "")
        rows.append(
            [_td("; ".join(laws), "text"), _td(share), _td(stays),
             _td("; ".join(item["why"]), "text")]
        )  # fmt: skip
    if not rows:
        return ""
    note = "<p class='note'>* to first order, not fitted</p>"
    return (
        "<h2>Hints</h2><p>The nearest laws of the catalogue, fitted with all parameters: what each "
        "would explain of what the declared model leaves beyond noise, which channel would stay "
        "farthest above its noise, and why it is not named.</p>"
        + _table(["laws", "explained", "stays", "no name, since"], rows)
        + (note if any(item["first_order"] for item in hints) else "")
    )


def _ratio(value: float | None, noise: float) -> str:
    if value is None:
        return _td("–")
    ratio = value / noise
    return f"<td class='{'over' if ratio > 1.1 else 'good'}'>{value:.4g} ({ratio:.2f}×)</td>"


def _errors(result: Diagnosis, table: dict[str, Any]) -> str:
    rows = []
    changed = bool(table["effects"])
    for name, row in table["channels"].items():
        cells = [_td(name), _td(row["unit"]), _td(_number(row["noise_rms"]))]
        for which in ("before", "after") if changed else ("before",):
            cells += [
                _ratio(row[which][p], row["noise_rms"]) for p in ("identification", "validation")
            ]
        rows.append(cells)
    head = ["channel", "unit", "noise", "fitted runs", "unused runs"]
    if changed:
        head = [
            *head[:3],
            "before: fitted",
            "before: unused",
            "after: fitted",
            "after: unused",
        ]
    return (
        "<h2>Errors of the model</h2><p>RMS difference between measurement and simulation; in "
        "brackets over the sensor's noise, which is the best a model can reach.</p>"
        + _table(head, rows)
        + _by_run(result)
    )


def _by_run(result: Diagnosis) -> str:
    names = [c.name for c in result.problem.channels]
    rows = []
    for run in result.problem.runs:
        cells = [_td(run.name), _td(run.purpose)]
        for column in range(len(names)):
            pair = []
            for which in ("before", "after"):
                values = result.residuals.get((which, run.name))
                one = values[:, column] if values is not None else np.array([np.nan])
                good = one[np.isfinite(one)]
                pair.append(float(np.sqrt(np.mean(good**2))) if good.size else float("nan"))
            text = f"{pair[0]:.2f}" if pair[0] == pair[1] else f"{pair[0]:.2f} → {pair[1]:.2f}"
            cells.append(_td(text, "over" if pair[1] > 1.1 else ""))
        rows.append(cells)
    return "<p>By run, over the noise:</p>" + _table(["run", "purpose", *names], rows)


def _further(found: list[dict[str, Any]]) -> str:
    parts = []
    for item in found:
        rows = [
            [_td(name), _td(row["unit"]), _td(_number(row["noise_rms"])),
             *(_ratio(row[which], row["noise_rms"]) for which in ("before", "after"))]
            for name, row in item["channels"].items()
        ]  # fmt: skip
        runs = escape(", ".join(item["runs"]))
        parts.append(
            f"<p>Runs {runs}, which need the system {escape(item['system'])}; nothing but their "
            "start values was fitted to them:</p>"
            + _table(["channel", "unit", "noise", "before", "after"], rows)
        )
    return "".join(parts)


def _parameters(parameters: dict[str, Any]) -> str:
    rows = []
    for name, entry in parameters.items():
        cells = [_td(name), _td(entry["unit"])]
        for which in ("before", "after"):
            value = entry.get(which)
            if value is None:
                cells += [_td("–"), _td("–")]
                continue
            cells += [_td(_number(value["value"])), _td(_interval(value))]
        rows.append(cells)
    return "<h2>Parameters</h2>" + _table(
        ["parameter", "unit", "before", "95 % interval", "after", "95 % interval"], rows
    )


def _starts(values: dict[str, dict[str, float]]) -> str:
    if not values:
        return ""
    names = list(next(iter(values.values())))
    return "<p>Start values, estimated run by run:</p>" + _table(
        ["run", *names],
        [[_td(run), *(_td(_number(own[n])) for n in names)] for run, own in values.items()],
    )


def _ended(times: dict[str, float]) -> str:
    if not times:
        return ""
    rows = [[_td(run), _td(f"{time:.2f} s")] for run, time in times.items()]
    return (
        "<p>Runs that the model has left where a small change of a start value decides what "
        "happens. From these times on they were not used to look for further effects; all tables "
        "have them in full.</p>" + _table(["run", "up to"], rows)
    )


def _bursts(spans: dict[str, list[tuple[float, float]]]) -> str:
    if not spans:
        return ""
    rows = [[_td(run), _td(written(parts))] for run, parts in spans.items()]
    return (
        "<p>Bursts of residuals, where the smallest difference decides when something happens "
        "(casters that turn over). They count little in the fits and fully in all tables.</p>"
        + _table(["run", "when"], rows)
    )


def _measured(result: Diagnosis) -> str:
    rows = []
    for run in result.problem.runs:
        gaps = float(np.mean(~np.isfinite(run.data))) if run.data.size else 0.0
        rows.append(
            [_td(run.name), _td(run.purpose), _td(f"{run.times[-1] - run.times[0]:.1f} s"),
             _td(str(run.times.size)), _td(f"{100 * gaps:.1f} %")]
        )  # fmt: skip
    return "<h2>What was measured</h2>" + _table(
        ["run", "used for", "duration", "samples", "gaps"], rows
    )


def _residuals(result: Diagnosis) -> str:
    parts = []
    shown = [r for r in result.problem.runs if ("before", r.name) in result.residuals]
    for column, channel in enumerate(result.problem.channels):

        def size(name: str, column: int = column) -> float:
            return float(
                np.nan_to_num(np.nanmean(result.residuals["before", name][:, column] ** 2))
            )

        for purpose in ("identification", "validation"):
            runs = [r for r in shown if r.purpose == purpose]
            if not runs:
                continue
            run = max(runs, key=lambda r: size(r.name))
            items = []
            for which, colour in (("before", COLOURS[2]), ("after", COLOURS[1])):
                values = result.residuals[which, run.name][:, column] * channel.sigma
                items.append(Line(which, run.times, values, colour))
            if result.after is result.before:
                items = items[:1]
            parts.append(
                lines(
                    items, title=f"{channel.name}, {run.name} ({purpose})", x_label="time [s]",
                    y_label=f"residual [{channel.unit}]", band=2 * channel.sigma,
                )
            )  # fmt: skip
    return (
        "<h2>Residuals</h2><p>Measurement less simulation, for each channel in the fitted and in "
        "the unused run that the declared model describes worst; grey: twice the noise.</p>"
        f"<div class='grid'>{''.join(parts)}</div>"
    )


def _located(result: Diagnosis) -> str:
    if not result.located:
        return ""
    rows = []
    for place in result.located[:PLACES]:
        best = place.curves[0]
        rows.append(
            [_td(place.label), _td(_number(place.evidence)), _td(_against(best)),
             _td(f"{100 * best.explained:.1f} %")]
        )  # fmt: skip
    charts = []
    for place in result.located[:CURVES]:
        for curve in place.curves[:2]:
            edge = 2 * curve.deviation
            charts.append(
                lines(
                    [Line("u", curve.at, curve.value),
                     Line("± 2 σ", curve.at, curve.value - edge, COLOURS[0]),
                     Line("", curve.at, curve.value + edge, COLOURS[0])],
                    title=f"{place.label} against {_against(curve)}",
                    x_label=curve.driver, y_label=f"u [{place.unit or 'its unit'}]",
                )
            )  # fmt: skip
    return (
        "<h2>Where the disturbance enters</h2><p>An unknown input at each place, with a free curve "
        "against time or against a signal there and no law assumed: how much more likely that "
        "makes the residual (log evidence), and how much of what exceeds the noise it takes away. "
        "Places that explain the same amount cannot be told apart by this alone.</p>"
        + _table(["place", "evidence [nats]", "best against", "explained"], rows)
        + f"<div class='grid'>{''.join(charts)}</div>"
    )


def _against(curve: Curve) -> str:
    return f"{curve.driver} ({curve.run})" if curve.run else curve.driver


def _ruled_out(count: int) -> str:
    """A line on the candidates that one run has shown to be none."""
    if not count:
        return ""
    return f"<p>{count} more were ruled out by the run with the largest excess over the noise.</p>"


def _candidates(result: Diagnosis) -> str:
    if result.search is None:
        return ""
    parts = []
    for number, stage in enumerate(result.search.rounds):
        fitted = {f.effects[-1].label: f for f in stage.fitted}
        rows = []
        for item in stage.signatures[:12]:
            label = item.candidate.label
            refit = fitted.get(label)
            gate = refit.gate if refit else None
            rows.append(
                [
                    _td(label + (" (added)" if refit is stage.winner and refit else "")),
                    _td(f"{item.score.gain:.1f}"), _td(f"{item.score.z:.1f}"),
                    _td(f"{stage.corrected[label]:.2g}"), _td(f"{100 * item.absorbed:.1f} %"),
                    _td(f"{result.search.gain(stage.base, refit):.1f}" if refit else "–"),
                    _td(f"{gate.gain:.1f} (z {gate.z:.1f})" if gate else "–"),
                    _td(", ".join(item.same) or "–", "text"),
                ]
            )  # fmt: skip
        parts.append(
            f"<h3>Round {number + 1}: {len(stage.signatures)} distinct candidates</h3>"
            + _ruled_out(len(stage.aside))
            + _table(
                [
                    "effect",
                    "score [nats]",
                    "z",
                    "p (Holm)",
                    "absorbed",
                    "refit [nats]",
                    "unused runs [nats]",
                    "same signature",
                ],
                rows,
            )
        )
    return (
        "<h2>Candidates</h2><p>Score: what the effect would explain of the part of the residual "
        "that calibration cannot absorb. The best are fitted with all declared parameters and "
        "judged on the unused runs.</p>" + "".join(parts)
    )


def _next(table: dict[str, Any]) -> str:
    proposal = table["proposed_experiment"]
    if not proposal:
        return ""
    factor = proposal["input_factor"]
    how = "as it was" if factor == 1.0 else f"with its inputs times {factor:g}"
    channels = sorted(proposal["channels"].items(), key=lambda item: -item[1])
    best = ", ".join(f"{name} ({value:.1f} σ)" for name, value in channels[:3])
    return (
        f"<h2>What to measure next</h2><p>Run {escape(proposal['run'])} {how}, "
        f"{proposal['repetitions']} time(s): there the two explanations stay "
        f"{proposal['distance']:.1f} σ apart after calibration. As they are, they differ most in "
        f"{escape(best)}.</p>"
    )


def _power(power: dict[str, Any]) -> str:
    rows = []
    for label, entry in power.items():
        value = entry["smallest_detectable"]
        note = entry.get("reason", "")
        if "extrapolated_from" in entry:
            note = f"from a simulation with {entry['extrapolated_from']:.3g}"
        rows.append([_td(label), _td(_number(value)), _td(entry["unit"]), _td(note, "text")])
    return (
        "<h2>What these runs would have shown</h2><p>Smallest strength of each effect that would "
        "have been found with 90 % probability; what is smaller may be there unseen.</p>"
        f"<details><summary>{len(rows)} effects</summary>"
        + _table(["effect", "strength", "unit", ""], rows)
        + "</details>"
        if rows
        else ""
    )
