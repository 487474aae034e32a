"""What a verdict means and what to do next, in sentences that show facts only."""

from __future__ import annotations

import shlex
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from ...calibrate.checks.finding import LASTING
from ...display.html import Html, command, join, quantity, tag, words
from ..adding import lines_of
from .facts import Facts, inside, misses, sentence, some
from .unexplained import compare, unexplained, white

ADVICE = Path(__file__).parent / "advice.toml"
LABELS = {
    "effect_found": "Something is missing, and it has a name",
    "nothing_missing": "Nothing is missing",
    "confounded": "Something is missing, with more than one explanation",
    "unexplained": "Something is missing that has no name here",
    "bad_data": "The data cannot be used",
    "stopped": "The search was stopped before its end",
    "white": "The noise is larger than stated",
}
SMALL = 3
"""Effects whose smallest visible size is said beside `nothing_missing`."""


@dataclass(frozen=True)
class Story:
    """The first screen in words.

    Attributes:
        label: the verdict in a few words.
        headline: one sentence.
        meaning: paragraphs.
        steps: what to do next, in order.
    """

    label: str
    headline: Html
    meaning: tuple[Html, ...]
    steps: tuple[Html, ...]


@cache
def advice() -> Mapping[str, Mapping[str, str]]:
    """Effect -> `means`, `check`."""
    return tomllib.loads(ADVICE.read_text(encoding="utf-8"))


def told(facts: Facts) -> Story:
    """The story of a diagnosis."""
    write = {
        "effect_found": _effect_found, "nothing_missing": _nothing_missing,
        "confounded": _confounded, "unexplained": unexplained, "bad_data": _bad_data,
        "stopped": _stopped, "white": white,
    }  # fmt: skip
    only_white = facts.verdict == "unexplained" and facts.table.get("left_white")
    kind = "stopped" if facts.table.get("stopped") else "white" if only_white else facts.verdict
    headline, meaning, steps = write[kind](facts)
    return Story(LABELS[kind], headline, tuple(meaning), tuple(steps))


# -- parts -----------------------------------------------------------------------------------------


def named(facts: Facts, effect: Mapping[str, Any]) -> Html:
    """An effect with its place, in words."""
    return join(inside(effect["text"]), ", ", facts.places_in_words(effect))


def in_words(proposal: Mapping[str, Any] | None) -> str:
    """What is to be measured."""
    if proposal is None:
        return "none of these runs, as it is, reversed, gentler or stronger, tells them apart"
    factor = proposal["input_factor"]
    how = "as it was" if factor == 1.0 else f"with its inputs times {factor:g}"
    return f"run {proposal['run']} {how}, {proposal['repetitions']} time(s)"


def label(effect: str, place: str) -> Html:
    """An effect with its place, as the tables name it."""
    return tag("code", f"{effect} at {place}" if place else effect)


def size(facts: Facts, number: int) -> Html:
    """The strength of an effect with its interval."""
    effect = facts.effects[number]
    name = facts.main_parameter(effect)
    if not name:
        return Html("")
    path = ("effects", number, "parameters", name)
    return join(facts.value(*path), " (95 %: ", facts.interval(*path), ")")


def _meant(effect: str, text: str) -> Html:
    return join(advice().get(effect, {}).get("means", f"{sentence(text)}."))


def _check(facts: Facts, effect: Mapping[str, Any]) -> Html:
    found = advice().get(effect["effect"], {}).get("check")
    what = found or "Look at this place of the machine and repeat the run that shows it most."
    where = facts.places_in_words(effect).removeprefix("at ")
    return join(tag("b", "Check"), " (", where, "): ", what)


def _before_after(facts: Facts) -> Html:
    worst = facts.worst
    if not worst:
        return Html("")
    return join(
        "On ", facts.runs_in_words, ", the declared model misses ", tag("b", worst), " by ",
        misses(facts, "before"), " its sensor's noise; with what was found, by ",
        misses(facts, "after"), ". 1× is the best that any model can do.",
    )  # fmt: skip


def same_traces(effect: Mapping[str, Any]) -> Html:
    """What leaves the same traces as an effect: itself elsewhere, or laws that are one with it."""
    if not effect["other_places"]:
        return Html("")
    others = words([tag("code", place) for place in effect["other_places"]], "or")
    return join(
        "The same effect at another place, or a law that contains it, leaves the same traces as ",
        label(effect["effect"], effect["place"]), ": these runs cannot tell it from ", others, ".",
    )  # fmt: skip


def _left(facts: Facts) -> Html:
    if not facts.left:
        return Html("")
    names = words([tag("b", name) for name in facts.left])
    if facts.table.get("left_white"):
        return join("What is left of ", names, " is white, and larger than its stated noise.")
    return join(
        "More is missing: the residual of ", names, " still holds more than noise.",
    )  # fmt: skip


def run_line(facts: Facts) -> str:
    """The command that runs the scenario with what was found, "" without a scenario."""
    model = facts.at("model")
    if not model["scenario"]:
        return ""
    changes = [f"--set {name}={variant}" for name, variant in model["variants"].items()]
    values = [f"--param {name}={value:.6g}" for name, value in model["values"].items()]
    return " ".join(["cosim run", shlex.quote(model["scenario"]), *changes, *values])


def _add(facts: Facts) -> list[Html]:
    """How to run the model as it was found."""
    model, line = facts.at("model"), run_line(facts)
    if any(name in facts.table.get("adapters", {}) for name in model["variants"]):
        return [join(
            tag("b", "Add it to the model"), ": ", tag("code", "system.toml"), " beside this page "
            "is your system with an adapter that carries it, and with all calibrated values.",
        )]  # fmt: skip
    system, mapping = lines_of(model, [effect["place"] for effect in facts.effects])
    if not system and not mapping:
        return []
    parts: list[object] = [tag("b", "Add it to the model")]
    if system:
        parts += [
            ": in the system file write", tag("pre", "\n".join(system)),
            "The FMU that carries it is in ", tag("code", "fmus/"), " beside this page.",
        ]  # fmt: skip
    if mapping:
        parts += [
            " To have it estimated with the rest, write in ", tag("code", "dataset.toml"),
            tag("pre", "\n".join(mapping)),
        ]  # fmt: skip
    if system and line:
        parts += [
            " Or run the scenario ", tag("code", model["scenario"]), " with it and all calibrated "
            "values (it compares with its own logs):", command(line),
        ]  # fmt: skip
    return [join(*parts)]


def _again(when: str) -> Html:
    return join(tag("b", "Diagnose again"), " (", tag("code", "cosim diagnose"), f") {when}.")


# -- verdicts --------------------------------------------------------------------------------------


def _effect_found(facts: Facts) -> tuple[Html, list[Html], list[Html]]:
    effects = facts.effects
    several = len(effects) > 1
    items = [
        join(named(facts, effect), *([" – ", size(facts, n)] if size(facts, n) else []))
        for n, effect in enumerate(effects)
    ]
    headline = join(
        f"The machine has {len(effects)} things that the model lacks: " if several
        else "The machine has something that the model lacks: ", words(items, "and"), ".",
    )  # fmt: skip
    meaning = [_meant(effect["effect"], effect["text"]) for effect in effects]
    meaning.append(_before_after(facts))
    meaning += [same_traces(effect) for effect in effects]
    meaning += [join(facts.table.get("inside", "")), _left(facts)]
    steps = [_check(facts, effect) for effect in effects]
    steps.append(
        join(tag("b", "Repair"), " what should not be there, or keep it and ", tag("b", "tell the "
             "model"), ".")
    )  # fmt: skip
    steps += _add(facts)
    steps.append(_again("with new logs after a repair; the effect should be gone"))
    return headline, some(meaning), steps


def _confounded(facts: Facts) -> tuple[Html, list[Html], list[Html]]:
    effects = facts.effects
    first = words([named(facts, effect) for effect in effects])
    others = [words([named(facts, e) for e in rival], "and") for rival in facts.rivals]
    headline = join(
        "The machine has something that the model lacks, and these runs fit more than one "
        "explanation: ", first, "; or ", words(others, "or"), ".",
    )  # fmt: skip
    meaning = [
        join("Either of them would leave the same traces in these runs. A wrong one may predict "
             "other motions badly, so measure before you repair.")
    ]  # fmt: skip
    others_named = {(e["effect"], e["place"]): e for rival in facts.rivals for e in rival}
    causes = [*effects, *others_named.values()]
    meaning += [
        join(label(e["effect"], e["place"]), ": ", _meant(e["effect"], e["text"])) for e in causes
    ]
    meaning += [same_traces(effect) for effect in effects]
    meaning += [join(facts.table.get("inside", "")), _before_after(facts), _left(facts)]
    steps = []
    proposal = facts.at("proposed_experiment")
    if proposal:
        steps.append(
            join(tag("b", "Measure"), f" {in_words(proposal)}: there the explanations stay ",
                 facts.number("proposed_experiment", "distance"), " σ apart after calibration.")
        )  # fmt: skip
        steps.append(_again("with these runs added to the data set"))
    else:
        steps.append(join(in_words(None).capitalize(), ": measure what only one of them changes."))
    steps += [_check(facts, e) for e in causes]
    steps += _add(facts)
    return headline, some(meaning), steps


def _nothing_missing(facts: Facts) -> tuple[Html, list[Html], list[Html]]:
    headline = join(
        "The model describes the machine as far as these runs can tell: what it misses is sensor "
        "noise."
    )
    meaning = [
        join("After calibration, the worst channel, ", tag("b", facts.worst), ", is missed by ",
             misses(facts, "after"), " its sensor's noise on ", facts.runs_in_words,
             ". 1× is the best that any model can do.")
        if facts.worst else Html(""),
        join("The catalogue was not asked for effects that make it better." if not facts.asked
             else "No effect of the catalogue makes it better on unused runs." if facts.judged
             else "No run was kept unused to judge effects of the catalogue by."),
        join("What is smaller than the sizes ", tag("a", "listed below", href="#power"),
             " may still be there unseen", _smallest(facts), ".")
        if facts.at("power") else Html(""),
    ]  # fmt: skip
    line = run_line(facts)
    steps = []
    if line:
        steps.append(join(tag("b", "Use the model"), " with its calibrated values:", command(line)))
    else:
        steps.append(
            join(tag("b", "Use the model"), " with the ",
                 tag("a", "calibrated values", href="#parameters"), ".")
        )  # fmt: skip
    open_ones = [
        name for name, entry in facts.at("parameters").items()
        if not entry.get("after", entry.get("before", {})).get("identifiable", True)
    ]  # fmt: skip
    if open_ones:
        names = words([tag("code", name) for name in open_ones])
        steps.append(
            join(tag("b", "Measure"), " ", names, " otherwise, or add runs that move more: these "
                 "runs alone do not determine ", "it." if len(open_ones) == 1 else "them.")
        )  # fmt: skip
    steps.append(
        join(tag("b", "If you still suspect something"), ": measure runs that would show it "
             "(faster, slower, loaded, reversing), and diagnose them.")
    )  # fmt: skip
    return headline, some(meaning), steps


def _smallest(facts: Facts) -> Html:
    """Some effects with the size from which they would have been seen, by name."""
    found = [
        (label, entry) for label, entry in facts.at("power").items()
        if entry["smallest_detectable"] is not None
    ]  # fmt: skip
    plain = ("viscous", "coulomb", "unbalance", "delay", "gain", "backlash", "payload")
    chosen = {}
    for kind in plain:
        for name, entry in found:
            if name.startswith(f"{kind} at ") and kind not in chosen:
                chosen[kind] = (name, entry)
    shown = [
        join(label(*name.split(" at ")), " below ",
             tag("span", quantity(entry["smallest_detectable"], entry["unit"]),
                 data_fact=f"smallest: power > {name}"))
        for name, entry in list(chosen.values())[:SMALL]
    ]  # fmt: skip
    return join(" (", words(shown), ")") if shown else Html("")


def _stopped(facts: Facts) -> tuple[Html, list[Html], list[Html]]:
    why = str(facts.at("stopped"))
    rest = (
        join("the calibrated model misses ", tag("b", facts.worst), " by ",
             misses(facts, "after"), " its sensor's noise")
        if facts.left else Html("the calibrated model leaves noise")
    )  # fmt: skip
    headline = join(f"The search was stopped {why}: so far, ", rest, ".")
    meaning = [
        join("Calibration went to its end, and not all effects of the catalogue were asked: "
             "nothing is named, and nothing is ruled out."),
    ]  # fmt: skip
    steps = [
        join(tag("b", "Let it go on"), " for longer: the same command with more simulated runs."),
        *compare(facts),
    ]
    return headline, meaning, steps


def _bad_data(facts: Facts) -> tuple[Html, list[Html], list[Html]]:
    errors = facts.errors
    first = _found_in(errors[0]) if errors else Html(sentence(str(facts.at("reason"))))
    more = f" There are {len(errors)} faults in all." if len(errors) > 1 else ""
    headline = join("These logs cannot be used. ", first, ".", more)
    meaning = [
        join("No effect was looked for: with such data, a search would "
             "find a cause in the machine for what is a fault of the logs.")
    ]  # fmt: skip
    steps = [
        join(tag("b", "Repair the logs"), ": the faults are listed ",
             tag("a", "below", href="#findings"), ", each with run and column.")
    ]  # fmt: skip
    kinds = list(dict.fromkeys(f["kind"] for f in errors if f["kind"] not in LASTING))
    if kinds:
        allowed = ", ".join(f'"{kind}"' for kind in kinds)
        steps.append(
            join(tag("b", "If the data are right"), " and the machine is so, let them pass in ",
                 tag("code", "dataset.toml"), ": ", tag("code", f"[checks] allow = [{allowed}]"),
                 ".")
        )  # fmt: skip
    steps.append(_again("afterwards"))
    return headline, meaning, steps


def _found_in(finding: Mapping[str, str]) -> Html:
    """A finding with its place."""
    run = f"Run {finding['run']}" if finding["run"] else ""
    where = ", ".join(part for part in (run, finding["column"]) if part)
    said = sentence(finding["text"].partition("; ")[0])
    return join(f"{where[:1].upper()}{where[1:]}: " if where else "", said)
