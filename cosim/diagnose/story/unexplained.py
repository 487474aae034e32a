"""What a page says of a machine that no law explains: where it acts, and what to look at."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...display.html import Html, join, tag, words
from .facts import Facts, misses, place_label, some

CREDIBLE = 0.5
"""Share of what exceeds the noise from which an unknown input at a place is said to explain it."""


def likely_place(facts: Facts) -> Mapping[str, Any] | None:
    """The place at which an unknown input explains most of what is missing, if there is one."""
    places = facts.at("localisation")
    where: Mapping[str, Any] | None = places[0] if places else None
    return where if where and best_curve(where)[1]["explained"] >= CREDIBLE else None


def best_curve(place: Mapping[str, Any]) -> tuple[int, Mapping[str, Any]]:
    """Number and content of the curve of greatest evidence at a place."""
    curves = place["curves"]
    number = max(range(len(curves)), key=lambda n: float(curves[n]["evidence_nats"]))
    return number, curves[number]


def unexplained(facts: Facts) -> tuple[Html, list[Html], list[Html]]:
    """Headline, what it means and what to do next, of a machine that no law explains."""
    where = likely_place(facts)
    at = place_label(where) if where else ""
    driver, law = "", facts.table.get("law_from_data") or {}
    likely = str(law["place"]) if law.get("made") else at
    headline = join(
        "The machine does something that ",
        "neither the model nor the catalogue knows" if facts.asked else "the model does not know",
        ": the model misses ", tag("b", facts.worst), " by ", misses(facts, "after"),
        " its sensor's noise",
        join("; what is missing enters most likely ", facts.in_words(likely)) if likely else "",
        ".",
    )  # fmt: skip
    left = words([tag("b", name) for name in facts.left])
    meaning = [
        join("The catalogue was not asked; calibration alone leaves more than noise in ", left, ".")
        if not facts.asked else
        join("Calibration and every effect of the catalogue were tried; ",
             join("none explains what is left of ", left, " on unused runs.") if facts.judged
             else join("no run was kept unused to judge by, so none is named for what is left of ",
                       left, ".")),
    ]  # fmt: skip
    bounds = words([tag("code", name) for name in facts.table.get("bounds_opened", {})])
    if bounds:
        meaning.append(
            join("Calibration ended at the bound that the mapping gives ", bounds, "; with more "
                 "room the model itself does better on unused runs. That may be all.")
        )  # fmt: skip
    meaning += _by_run(facts)
    if law.get("made"):
        meaning.append(
            join("A law made from the data says more: ", tag("code", law["formula"]), " at ",
                 tag("code", law["place"]), " holds on unused runs; " if facts.judged
                 else " explains the fitted runs, and none was kept unused to judge it; ",
                 tag("a", "its curve, and what it leaves", href="#law"), ".")
        )  # fmt: skip
    if where is not None:
        number, best = best_curve(where)
        driver = best["driver"].replace("_", " ")
        meaning.append(
            join("An unknown input at ", tag("code", at), ", free in its course over ",
                 tag("b", driver), ", would take away ",
                 facts.percent("localisation", 0, "curves", number, "explained"),
                 " of what exceeds the noise in the run that shows it most. ",
                 tag("a", "Its curve", href="#where"), " is what the missing law looks like.")
        )  # fmt: skip
    elif facts.at("localisation") and not law.get("made"):
        meaning.append(
            join("No unknown input at a single place that was probed explains half of it (",
                 tag("a", "places", href="#where"), "): the cause may lie elsewhere, or in several "
                 "places.")
        )  # fmt: skip
    meaning.append(join(facts.table.get("inside", "")))
    steps = compare(facts)
    if bounds:
        steps.insert(
            0,
            join(
                tag("b", "Look at the bounds"),
                " of ",
                bounds,
                " in the mapping. If "
                "the machine may be beyond them, widen them and diagnose again.",
            ),
        )
    if by_run := facts.table.get("by_run"):
        steps.insert(
            0,
            join(tag("b", "Look for what differs between the runs"), " and moves ",
                 tag("code", by_run[0]["parameter"]), ": load, floor, temperature, supply, a part "
                 "that was changed."),
        )  # fmt: skip
    if not facts.asked:
        steps.append(
            join(tag("b", "Ask the catalogue"), ": the same command without ",
                 tag("code", "--law-from-data"), ".")
        )  # fmt: skip
    if law.get("made"):
        at, driver = str(law["place"]), str(law["depends_on"])
    if at:
        steps.append(
            join(tag("b", "Look"), " ", facts.in_words(at), ": what there depends on ",
                 tag("b", driver.replace("_", " ")), "?")
        )  # fmt: skip
    steps += [
        join(tag("b", "Repeat"), " the run that shows it most, once slower and once with another "
             "load: what changes tells what it hangs on."),
        join(tag("b", "Write the law"), " as an effect (one file with its equation), or use a "
             "finer variant of the component, and diagnose again."),
    ]  # fmt: skip
    return headline, some(meaning), steps


def white(facts: Facts) -> tuple[Html, list[Html], list[Html]]:
    """The same of one that leaves white noise."""
    names = words([tag("b", name) for name in facts.left])
    headline = join("The model misses ", tag("b", facts.worst), " by ", misses(facts, "after"),
                    " its sensor's stated noise, and what it misses is white.")  # fmt: skip
    meaning = [
        join("Samples of what is left of ", names, " do not know of each other, neither neighbours "
             "nor over long times. A force or a law of motion does not do that: the noise is "
             "larger than the mapping says, or the sensor errs otherwise from sample to sample."),
    ]  # fmt: skip
    steps = [
        join(tag("b", "Look at the figure"), " of ", names, " (", tag("code", "sigma"),
             " in the mapping): a log at rest shows the noise. Correct it and diagnose again."),
        join(tag("b", "If the figure is right"), ", look at what differs from sample to sample: "
             "rounding, times of the samples, interference."),
    ]  # fmt: skip
    return headline, some(meaning), steps


def compare(facts: Facts) -> list[Html]:
    """What to do with the nearest laws."""
    if not facts.table.get("hints"):
        return []
    return [
        join(tag("b", "Compare"), " with the ", tag("a", "nearest laws", href="#hints"),
             ": what they would take, and what they leave.")
    ]  # fmt: skip


def _by_run(facts: Facts) -> list[Html]:
    """What is said of parameters that may differ between runs."""
    found = facts.table.get("by_run") or []
    if not found:
        return []
    names = [tag("code", item["parameter"]) for item in found]
    values = found[0]["values"]
    sizes = words(
        [join(facts.value("by_run", 0, "values", run), " in ", run)
         for run, value in values.items() if value["identifiable"]]
    )  # fmt: skip
    other = join(" The data do not tell it from ", words(names[1:]), ".") if names[1:] else Html("")
    return [
        join("One value of ", names[0], " for each run would take away ",
             facts.percent("by_run", 0, "explained"), " of what exceeds the noise: ", sizes,
             ".", other)
    ]  # fmt: skip
