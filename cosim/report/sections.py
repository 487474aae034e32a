"""The details of a report: tables of everything that a diagnosis found."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..diagnose.bursts import written
from ..diagnose.story.facts import Facts, named_unit, place_label
from ..diagnose.story.verdicts import label
from ..diagnose.whiteness import CALIBRATED
from ..display.document import section
from ..display.html import Cell, Html, explained, join, number, table, tag, words
from ..display.series import Store
from .figures import unknown_curve, used
from .material import Material

PLACES, CURVES = 8, 2
"""Places that are listed, and those whose curves are drawn."""
WORDS = {
    "noise": "Standard deviation of the sensor's noise, rounding included.",
    "RMS": "Root mean square: the size of an error, whatever its sign.",
    "nats": "Natural logarithm of how many times more likely the data become; 4.6 nats: a hundred "
    "times.",
    "z": "In standard deviations of what chance would give.",
    "p (Holm)": "Probability of such a score by chance, corrected for the number of candidates.",
    "absorbed": "Share of the effect's trace that other parameters could take over.",
    "95 % interval": "Where the true value lies with 95 % probability; open: it rests on the "
    "declared bounds, the data alone do not determine it.",
    "score": "What the effect would explain, to first order, of what calibration cannot.",
    "refit": "Log likelihood that is gained when the model is fitted again with the effect.",
    "unused": "Runs that were not used for fitting: they judge.",
    "fitted": "Runs that the parameters were fitted to.",
    "σ": "Standard deviation of the noise.",
}
"""Words of the report that need an explanation."""


def _head(*names: str) -> list[object]:
    return [(name, WORDS[name]) if name in WORDS else name for name in names]


def findings(facts: Facts) -> Html:
    """What was found in the data."""
    found = facts.table.get("findings", [])
    rows = [
        [Cell(f["severity"], {"error": 2.0, "warning": 1.0}.get(f["severity"], 0.0),
              "over" if f["severity"] == "error" else ""),
         f["run"] or "all", f["column"] or "–", Cell(f["text"], kind="text")]
        for f in found
    ]  # fmt: skip
    said = tuple(f"{severity}: " for severity in ("error", "warning", "note"))
    others = [text for text in facts.table.get("warnings", ()) if not text.startswith(said)]
    return section(
        "findings", "Remarks",
        table(["", "run", "column", "what, and the way out"], rows, "remarks on the data"),
        *(tag("p", text, class_="over") for text in others),
    )  # fmt: skip


def effects(facts: Facts, symbols: Mapping[str, str]) -> Html:
    """The effects with their parameters."""
    parts: list[object] = []
    for n, item in enumerate(facts.effects):
        rows = [
            [explained(name, symbols.get(f"{item['place']}.{item['effect']}.{name}", "")),
             Cell(facts.value("effects", n, "parameters", name), entry["value"]),
             Cell(facts.interval("effects", n, "parameters", name), entry["ci95"][0])]
            for name, entry in item["parameters"].items()
        ]  # fmt: skip
        said: list[object] = []
        if item["explained"] is not None:
            said += ["It explains ", facts.percent("effects", n, "explained"),
                     " of what the residual held beyond noise. "]  # fmt: skip
        if item["validation_gain_nats"] is not None:
            said += ["On unused runs, it makes the data more likely by ",
                     facts.number("effects", n, "validation_gain_nats"), " ",
                     explained("nats", WORDS["nats"]), "."]  # fmt: skip
        places = ", ".join(item["other_places"])
        parts += [
            tag("h3", label(item["effect"], item["place"])),
            tag("p", *said),
            table(_head("parameter", "value", "95 % interval"), rows, "parameters of the effect"),
            tag("p", "Held: ", words([join(name, " = ", facts.number("effects", n, "held", name))
                                      for name in item["held"]]), ".", class_="note")
            if item["held"] else "",
            tag("p", f"The data do not tell it from: {places}.", class_="note")
            if places else "",
        ]  # fmt: skip
    return section("effects", "What was found", *parts)


def errors(facts: Facts, material: Material) -> Html:
    """Errors of the models by channel, and by run."""
    changed = len({kind for run in material.runs for kind in run.residuals}) > 1
    kinds = ("before", "after") if changed else ("before",)
    rows: list[list[object]] = []
    for name, row in facts.at("channels").items():
        if row["before"]["identification"] is None and row["before"]["validation"] is None:
            continue
        cells: list[object] = [name, named_unit(row["unit"]), row["noise_rms"]]
        cells += [
            facts.error_cell("channels", name, which, purpose)
            for which in kinds
            for purpose in ("identification", "validation")
        ]
        rows.append(cells)
    titles = [
        (f"{which}, {used(p)} runs" if changed else f"{used(p)} runs", WORDS[used(p)])
        for which in kinds
        for p in ("identification", "validation")
    ]
    main = table(["channel", "unit", ("noise", WORDS["noise"]), *titles], rows, "errors by channel")
    if not main:
        return Html("")
    return section(
        "errors", "Errors of the model",
        tag("p", explained("RMS", WORDS["RMS"]), " difference between measurement and simulation; "
            f"in brackets over the noise. From {CALIBRATED}× on, and with slow parts that noise "
            "does not have, something is missing."),
        main,
        by_run(material),
        further(facts),
    )  # fmt: skip


def by_run(material: Material) -> Html:
    """Errors over the noise, run by run."""
    rows = []
    for run in material.runs:
        cells: list[object] = [run.name, used(run.purpose)]
        for column in range(len(material.channels)):
            sizes = [float(np.sqrt(run.excess(column, kind))) for kind in run.residuals]
            cells.append(
                Cell(" → ".join(f"{size:.2f}" for size in sizes), sizes[-1],
                     "over" if sizes[-1] > CALIBRATED else "")
                if sizes else Cell("–")
            )  # fmt: skip
        rows.append(cells)
    head = ["run", "used as", *(channel.name for channel in material.channels)]
    return join(tag("h3", "By run, over the noise"), table(head, rows, "errors by run"))


def further(facts: Facts) -> Html:
    """Errors on runs that need another system."""
    parts: list[object] = []
    for n, item in enumerate(facts.at("further_runs")):
        rows = [
            [name, named_unit(row["unit"]), row["noise_rms"],
             *(facts.error_cell("further_runs", n, "channels", name, which)
               for which in ("before", "after"))]
            for name, row in item["channels"].items()
        ]  # fmt: skip
        parts += [
            tag("p", f"Runs {', '.join(item['runs'])}, which need the system {item['system']}; "
                "nothing but their start values was fitted to them:"),
            table(_head("channel", "unit", "noise", "before", "after"), rows, "further runs"),
        ]  # fmt: skip
    return join(*parts)


def parameters(facts: Facts, symbols: Mapping[str, str]) -> Html:
    """Calibrated parameters before and after, and start values of runs."""
    entries = facts.at("parameters")
    changed = bool(facts.effects)
    kinds = ("before", "after") if changed else ("after",)
    rows = []
    for name, entry in entries.items():
        cells: list[object] = [explained(name, symbols.get(name, "")), named_unit(entry["unit"])]
        for which in kinds:
            value = entry.get(which)
            cells += (
                [Cell("–"), Cell("–")] if value is None
                else [Cell(number(value["value"]), value["value"]),
                      Cell(facts.interval("parameters", name, which), value["ci95"][0],
                           "" if value["identifiable"] else "over")]
            )  # fmt: skip
        rows.append(cells)
    head = ["parameter", "unit"]
    for which in kinds:
        head += [which if changed else "value", "95 % interval"]
    return section(
        "parameters", "Parameters", table(_head(*head), rows, "calibrated parameters"),
        clocks(facts), starts(facts.at("start_values")),
    )  # fmt: skip


def clocks(facts: Facts) -> Html:
    """How late clocks were found to be."""
    rows = [
        [name, Cell(facts.value("clocks", name), item["value"]),
         Cell(facts.interval("clocks", name), item["ci95"][0],
              "" if item["identifiable"] else "over"),
         "at a bound" if item["at_bound"] else ""]
        for name, item in facts.table.get("clocks", {}).items()
    ]  # fmt: skip
    if not rows:
        return Html("")
    return join(
        tag("h3", "Clocks that were estimated: late by"),
        table(["clock", "late by", ("95 % interval", WORDS["95 % interval"]), ""], rows, "clocks"),
    )  # fmt: skip


def starts(values: Mapping[str, Mapping[str, float]]) -> Html:
    """Start values that were estimated run by run."""
    if not values:
        return Html("")
    names = list(next(iter(values.values())))
    rows = [[run, *(own[name] for name in names)] for run, own in values.items()]
    return join(
        tag("h3", "Start values, estimated run by run"),
        table(["run", *names], rows, "start values"),
    )


def ended(times: Mapping[str, float]) -> Html:
    """Until when runs counted."""
    if not times:
        return Html("")
    rows = [[run, Cell(f"{time:.2f} s", time)] for run, time in times.items()]
    return join(
        tag("p", "Runs that the model has left where a small change of a start value decides what "
            "happens. From these times on they were not used to look for further effects; all "
            "tables have them in full."),
        table(["run", "up to"], rows, "where runs turn unstable"),
    )  # fmt: skip


def bursts(spans: Mapping[str, list[tuple[float, float]]]) -> Html:
    """Times of sudden residuals."""
    if not spans:
        return Html("")
    rows = [[run, Cell(written(parts), kind="text")] for run, parts in spans.items()]
    return join(
        tag("p", "Bursts of residuals, where the smallest difference decides when something "
            "happens (casters that turn over). They count little in the fits and fully in all "
            "tables."),
        table(["run", "when"], rows, "bursts"),
    )  # fmt: skip


def measured(facts: Facts, material: Material) -> Html:
    """The runs, and what of them counts less."""
    rows = []
    for run in material.runs:
        gaps = float(np.mean(~np.isfinite(run.data))) if run.data.size else 0.0
        length = float(run.times[-1] - run.times[0]) if run.times.size else 0.0
        rows.append(
            [run.name, used(run.purpose), Cell(f"{length:.1f} s", length),
             Cell(str(run.times.size), float(run.times.size)), Cell(f"{100 * gaps:.1f} %", gaps)]
        )  # fmt: skip
    return section(
        "runs", "What was measured",
        table(["run", "used as", "duration", "samples", "gaps"], rows, "runs"),
        ended(facts.at("unstable_from")), bursts(facts.at("bursts")),
    )  # fmt: skip


def _against(curve: Mapping[str, Any]) -> str:
    name = str(curve["driver"]).replace("_", " ")
    return f"{name} ({curve['run']})" if curve["run"] else name


def located(facts: Facts, store: Store) -> Html:
    """Where an unknown input would have to enter, and its curves."""
    places = facts.at("localisation")
    rows, plots = [], []
    for n, place in enumerate(places[:PLACES]):
        best = place["curves"][0]
        rows.append(
            [tag("code", place_label(place)), place["evidence_nats"],
             Cell(_against(best), kind="text"),
             Cell(facts.percent("localisation", n, "curves", 0, "explained"), best["explained"])]
        )  # fmt: skip
        if n < CURVES:
            plots += [
                unknown_curve(store, f"unknown {n} {k}", place_label(place), place["unit"], curve)
                for k, curve in enumerate(place["curves"][:2])
            ]
    if not rows:
        return Html("")
    return section(
        "where", "Where the disturbance enters",
        tag("p", "An unknown input at each place, with a free curve against time or against a "
            "signal there and no law assumed: how much more likely that makes the residual, and "
            "how much of what exceeds the noise it takes away. Places that explain the same amount "
            "cannot be told apart by this alone."),
        table(["place", ("evidence [nats]", WORDS["nats"]), "best against", "explained"], rows,
              "places"),
        tag("div", *plots, class_="grid"),
    )  # fmt: skip


def candidates(material: Material) -> Html:
    """Rounds of the search."""
    parts: list[object] = []
    runs = "unused" if Facts(material.table).judged else "fitted"
    for number_, stage in enumerate(material.candidates):
        rows = []
        for name, score, z, p, absorbed, refit, gain, gain_z, same in stage.rows:
            mark = " (added)" if name == stage.added else ""
            rows.append(
                [join(tag("code", name), mark), score, z, Cell(f"{p:.2g}", p),
                 Cell(f"{100 * absorbed:.1f} %", absorbed), refit,
                 Cell("–") if gain is None else Cell(f"{number(gain)} (z {gain_z:.1f})", gain),
                 Cell(same or "–", kind="text")]
            )  # fmt: skip
        aside = (
            f", {stage.aside} more ruled out by the run with the largest excess over the noise"
            if stage.aside else ""
        )  # fmt: skip
        parts += [
            tag("h3", f"Round {number_ + 1}: {stage.count} distinct candidates{aside}"),
            table(
                [
                    "effect", ("score [nats]", WORDS["score"]), ("z", WORDS["z"]),
                    ("p (Holm)", WORDS["p (Holm)"]), ("absorbed", WORDS["absorbed"]),
                    ("refit [nats]", WORDS["refit"]),
                    ("unused runs [nats]", WORDS["unused"]) if runs == "unused"
                    else "fitted runs [nats]",
                    "same signature",
                ],
                rows, f"candidates of round {number_ + 1}",
            ),
        ]  # fmt: skip
    if not parts:
        return Html("")
    return section(
        "candidates", "Candidates",
        tag("p", "The best by score are fitted with all declared parameters and judged on the "
            f"{runs} runs."),
        *parts,
    )  # fmt: skip


def power(facts: Facts) -> Html:
    """What would have been seen."""
    rows: list[list[object]] = []
    for name, entry in facts.at("power").items():
        value = entry["smallest_detectable"]
        note = entry.get("reason", "")
        if "extrapolated_from" in entry:
            note = f"from a simulation with {entry['extrapolated_from']:.3g}"
        shown = tag("span", f"{number(value)} {named_unit(entry['unit'])}".replace(" –", ""),
                    data_fact=f"smallest: power > {name}")  # fmt: skip
        rows.append([tag("code", name), Cell(shown, value), Cell(note, kind="text")])
    if not rows:
        return Html("")
    return section(
        "power", "What these runs would have shown",
        tag("p", "Smallest strength of each effect that would have been found with 90 % "
            "probability; what is smaller may be there unseen."),
        tag("details", tag("summary", f"{len(rows)} effects"),
            table(["effect", "smallest strength", ""], rows, "smallest visible strengths")),
    )  # fmt: skip


def glossary(material: Material) -> Html:
    """Every symbol and word of the report."""
    entries = {**material.symbols, **WORDS}
    items = [piece for name, meaning in entries.items()
             for piece in (tag("dt", name), tag("dd", meaning))]  # fmt: skip
    return section("symbols", "Symbols and words", tag("dl", *items, class_="symbols"))
