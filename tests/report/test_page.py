"""A report says one thing: in its sentences, its tables and its JSON."""

from __future__ import annotations

import re
import shlex
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from cosim.diagnose.adding import lines_of
from cosim.diagnose.candidates import READS
from cosim.diagnose.story.facts import Facts, inside, place_in_words
from cosim.diagnose.story.verdicts import ADVICE, LABELS, run_line, told
from cosim.report import page as pages
from cosim.report.page import rendered
from sources.variant import effects
from tests.report.marked import Marked, expected
from tests.report.stories import EFFECT, PLACE, VERDICTS, material, table

WHICH = ("before", "after")


@pytest.mark.parametrize("verdict", VERDICTS)
def test_sentences_tables_and_json_say_the_same(verdict: str) -> None:
    shown = material(verdict)
    found = Marked(rendered(shown))
    for fact, texts in found.facts.items():
        assert set(texts) == {expected(dict(shown.table), fact)}, fact
    if verdict != "bad_data":
        # the worst channel is told in a sentence, as a figure and in a table
        assert len(found.facts["ratio: channels > speed > before > validation"]) >= 2


@pytest.mark.parametrize("verdict", VERDICTS)
def test_a_verdict_has_its_own_words_and_those_of_no_other(verdict: str) -> None:
    text = Marked(rendered(material(verdict))).text
    assert LABELS[verdict] in text
    assert not [other for name, other in LABELS.items() if name != verdict and other + "." in text]
    lacks, known = "the model lacks" in text, "describes the machine" in text
    assert lacks == (verdict in ("effect_found", "confounded"))
    assert known == (verdict == "nothing_missing")
    assert ("cannot be used" in text) == (verdict == "bad_data")
    story = told(Facts(table(verdict)))
    assert story.meaning and len(story.steps) >= 2
    assert "nan" not in text and "None" not in text


def test_what_a_technician_needs_comes_first() -> None:
    text = Marked(rendered(material("effect_found"))).text
    order = ["Something is missing, and it has a name",
             "Coulomb friction of a shaft, at the flange of the load",
             "Dry friction: a constant torque", "Raise the torque slowly", "cosim run motor_bench",
             "Before → after: speed", "What was found", "Errors of the model"]  # fmt: skip
    places = [text.find(part) for part in order]
    assert -1 not in places and places == sorted(places)


def test_a_rival_of_two_laws_is_told_with_both() -> None:
    content = table("confounded")
    rivals = (["coulomb at load.flange", "cogging at x.shaft"], ["unbalance at load.flange",
              "cogging at x.shaft"])  # fmt: skip
    content["alternatives"] = [{"effects": names, "score": 0.0} for names in rivals]
    text = Marked(str(told(Facts(content)).headline)).text
    for effect in ("coulomb", "unbalance"):
        assert f"{effect}, at the flange of the load and cogging, at " in text


def test_where_no_run_tells_them_apart_none_is_proposed() -> None:
    content = table("confounded")
    said = "None of these runs, as it is, reversed, gentler or stronger, tells them apart"
    assert said not in "".join(told(Facts(content)).steps)
    content["proposed_experiment"] = None
    assert said in "".join(told(Facts(content)).steps)


def test_more_that_is_missing_is_said_only_where_it_is() -> None:
    content = table("effect_found")
    said = "More is missing"
    assert said not in "".join(told(Facts(content)).meaning)
    content["left"] = ["speed"]
    assert said in "".join(told(Facts(content)).meaning)


def test_a_place_is_named_only_where_it_explains_most() -> None:
    content = table("unexplained")
    assert "the flange of the load" in told(Facts(content)).headline
    content["localisation"][0]["curves"][0]["explained"] = 0.3
    story = told(Facts(content))
    assert "flange" not in story.headline and "in several places" in "".join(story.meaning)


def test_a_search_that_was_stopped_claims_nothing() -> None:
    content = table("unexplained") | {"stopped": "after 300 simulated runs"}
    story = told(Facts(content))
    assert story.label == "The search was stopped before its end"
    assert "stopped after 300 simulated runs: so far, the calibrated model misses" in story.headline
    assert "nothing is named, and nothing is ruled out" in "".join(story.meaning)
    assert "were tried" not in "".join(story.meaning) and "Let it go on" in story.steps[0]
    content["left"] = []
    assert "leaves noise" in told(Facts(content)).headline


def test_a_parameter_that_differs_between_runs_is_told_with_its_values() -> None:
    one = {"unit": "N.m.s/rad", "ci95": [0.02, 0.05], "identifiable": True}
    values = {
        "cold": {**one, "value": 0.045}, "warm": {**one, "value": 0.0271},
        "still": {**one, "value": 0.3, "identifiable": False},
    }  # fmt: skip
    item = {"parameter": "b", "unit": "N.m.s/rad", "explained": 0.998, "values": values, "left": []}
    content = table("unexplained") | {"by_run": [item, item | {"parameter": "J"}]}
    story = told(Facts(content))
    said = Marked("".join(story.meaning))
    assert "One value of b for each run would take away 99.8 % of what exceeds" in said.text
    assert "in cold and" in said.text and "still" not in said.text
    assert "The data do not tell it from J." in said.text
    for fact, texts in said.facts.items():
        assert set(texts) == {expected(content, fact)}, fact
    assert "what differs between the runs" in Marked(str(story.steps[0])).text
    assert "One value of" not in "".join(told(Facts(table("unexplained"))).meaning)


def test_white_leftovers_are_told_as_noise() -> None:
    content = table("unexplained")
    assert "What is left" not in told(Facts(content)).label
    content["left_white"] = True
    story = told(Facts(content))
    assert story.label == "The noise is larger than stated"
    assert "what it misses is white" in Marked(str(story.headline)).text
    assert "sigma" in story.steps[0]
    content = table("effect_found") | {"left_white": True, "left": ["speed"]}
    assert "is white, and larger than its stated noise" in Marked(
        str("".join(told(Facts(content)).meaning))
    ).text  # fmt: skip


@pytest.mark.parametrize(
    ("column", "channels"),
    [
        ("Winkel phi", ["Winkel phi"]), ("phi and Winkel phi", ["Winkel phi", "phi"]),
        ("phi, w [rad]", ["phi", "w [rad]"]), ("phi", ["phi"]), ("time", []),
        ("salt and pepper", ["salt and pepper"]),
    ],
)  # fmt: skip
def test_the_channels_of_a_finding_are_found_whatever_they_are_called(
    column: str, channels: list[str]
) -> None:
    names = ("Winkel phi", "phi", "w [rad]", "salt", "salt and pepper")
    facts = Facts({}, {name: "encoder.w" for name in names})
    assert facts.concerned({"column": column}) == channels


def test_findings_that_cannot_be_let_pass_are_not_offered_to_be() -> None:
    content = table("bad_data")
    assert "allow = [&quot;spikes&quot;]" in "".join(told(Facts(content)).steps)
    content["findings"][0]["kind"] = "short"  # too few samples: nothing can be fitted to them
    assert "allow" not in "".join(told(Facts(content)).steps)


def test_what_to_write_is_toml_with_the_values_that_were_found() -> None:
    """An effect's own start value is another one: a model with it alone would be worse."""
    content = table("effect_found")
    content["model"]["logged"] = {"column:gain:speed": -0.02, "clock:current": 0.0}
    system, mapping = lines_of(content["model"], ["load.flange"])
    written = tomllib.loads("\n".join(system))
    assert written["instances"] == {"load": "inertia.lab_bench/disc+coulomb@flange"}
    assert written["parameters"] == {"load.flange.coulomb.tau_c": 0.43781}
    entries = tomllib.loads("\n".join(mapping))["parameter"]
    assert {e["targets"]: e["nominal"] for e in entries} == {
        "load.flange.coulomb.tau_c": 0.43781, "column:gain:speed": -0.02, "clock:current": 0.0,
    }  # fmt: skip
    assert all(e["min"] < e["nominal"] < e["max"] for e in entries)
    steps = "".join(told(Facts(content)).steps)
    assert "load.flange.coulomb.tau_c&quot; = 0.43781" in steps and "[[parameter]]" in steps


def test_without_a_scenario_no_command_is_invented() -> None:
    content = table("effect_found")
    assert run_line(Facts(content)).startswith("cosim run motor_bench --set load=")
    content["model"]["scenario"] = ""
    assert run_line(Facts(content)) == "" and "cosim run" not in "".join(told(Facts(content)).steps)


@pytest.mark.slow  # builds an FMU
def test_the_command_of_a_report_runs() -> None:
    import cosim

    words = shlex.split(run_line(Facts(table("effect_found"))))
    assert words[:3] == ["cosim", "run", "motor_bench"]
    variants = {name: value for flag, name, value in _options(words) if flag == "--set"}
    values = {name: float(value) for flag, name, value in _options(words) if flag == "--param"}
    assert variants and values
    result = cosim.run("motor_bench", variants=variants, parameters=values, duration=0.02)
    assert not any(run.recording.error for run in result.runs.values())


def _options(words: list[str]) -> list[tuple[str, str, str]]:
    """(option, name, value) of a command's options."""
    found = []
    for flag, pair in zip(words[3::2], words[4::2], strict=True):
        name, _, value = pair.partition("=")
        found.append((flag, name, value))
    return found


def test_optional_parts_are_shown_only_where_they_are() -> None:
    shown = material("unexplained")
    plain = rendered(shown)
    assert 'id="hints"' not in plain and 'id="law"' not in plain
    more = dict(shown.table)
    value = {"value": -1.5, "ci95": [-2.0, -1.0], "unit": "N.m", "identifiable": True}
    law = {"effect": "stribeck", "component": "load", "port": "flange", "place": "load.flange",
           "parameters": {"tau_s": value}}  # fmt: skip
    left = {"channel": "speed", "purpose": "validation", "times_noise": 2.5}
    more["hints"] = [{"effects": [law], "explained": 0.61, "left": left, "first_order": False,
                      "why": ["its strength has the wrong sign"]}]  # fmt: skip
    more["law_from_data"] = {
        "place": "load.flange", "unit": "N.m", "made": True, "formula": "-0.4 sign(velocity)",
        "depends_on": "velocity",
        "curve": {"driver": "velocity", "at": [-1.0, 0.0, 1.0], "value": [0.4, 0.0, -0.4],
                  "deviation": [0.1, 0.1, 0.1]},
        "error": {"speed": {"noise_rms": 0.155, "before": {"validation": 0.5},
                            "after": {"validation": 0.16}}},
    }  # fmt: skip
    text = Marked(rendered(replace(shown, table=more))).text
    for part in (
        "Nearest laws",
        "tau_s = -1.5 N·m",
        "61.0 %",
        "speed at 2.50×",
        "A law from the data",
        "0.16 (1.03×)",
        "-0.4 sign(velocity) at load.flange holds on unused runs",
        "what there depends on velocity?",
    ):
        assert part in text


def test_a_law_over_two_signals_is_shown_in_slices_and_none_with_its_reason() -> None:
    shown = material("unexplained")
    more = dict(shown.table)
    grid = [[x, y] for x in (-1.0, 1.0) for y in (0.0, 1.0, 2.0, 3.0, 4.0)]
    more["law_from_data"] = {
        "place": "load.flange", "unit": "N.m", "reason": "It holds.",
        "formula": "smooth surface over velocity x angle",
        "signals": [{"name": "velocity"}, {"name": "angle"}],
        "curve": {"driver": "velocity", "shape": [2, 5], "x": [x for x, _ in grid],
                  "y": [y for _, y in grid], "value": [x * y for x, y in grid]},
        "nearest": [{"effect": "coulomb", "place": "load.flange", "rms_difference": 0.25,
                     "unused_runs_prefer_the_law_by_nats": 30.0}],
    }  # fmt: skip
    text = rendered(replace(shown, table=more))
    for part in (
        "smooth surface over velocity x angle",
        "angle 1",
        "angle 2",
        "angle 3",
        "coulomb",
    ):
        assert part in text
    more["law_from_data"] = {"place": "load.flange", "made": False, "reason": "Nothing varies."}
    text = rendered(replace(shown, table=more))
    assert "No law from the data" in text and "Nothing varies." in text


@pytest.mark.parametrize("unused", [True, False], ids=["unused runs", "all fitted"])
@pytest.mark.parametrize("asked", [True, False], ids=["catalogue", "law from data"])
def test_what_was_not_asked_or_not_judged_is_not_claimed(unused: bool, asked: bool) -> None:
    claims = {}
    for verdict in ("unexplained", "nothing_missing"):
        shown = material(verdict)
        more = dict(shown.table, catalogue_asked=asked)
        error = {"identification": 0.17, "validation": 0.16}
        nearest = {"effect": "coulomb", "place": "load.flange", "rms_difference": 0.25,
                   "unused_runs_prefer_the_law_by_nats": 30.0}  # fmt: skip
        if not unused:
            for row in [error, *(r[w] for r in more["channels"].values() for w in WHICH)]:
                row["validation"] = None
            nearest |= {"unused_runs_prefer_the_law_by_nats": None,
                        "fitted_runs_prefer_the_law_by_nats": 30.0}  # fmt: skip
        if verdict == "unexplained":
            more["hints"] = [{"effects": [dict(EFFECT)], "explained": 0.61, "left": None,
                              "why": ["no run was kept"]}]  # fmt: skip
            more["law_from_data"] = {
                "place": "load.flange", "unit": "N.m", "made": True, "formula": "-0.4 sign(w)",
                "depends_on": "velocity", "nearest": [nearest],
                "curve": {"driver": "velocity", "at": [-1.0, 1.0], "value": [0.4, -0.4],
                          "deviation": [0.1, 0.1]},
                "error": {"speed": {"noise_rms": 0.155, "before": error, "after": error}},
            }  # fmt: skip
        claims[verdict] = Marked(rendered(replace(shown, table=more))).text
    said, none = claims["unexplained"], claims["nothing_missing"]
    for text in (said, none):
        assert ("The catalogue was not asked" in text) is not asked
    assert ("every effect of the catalogue were tried" in said) is asked
    assert ("nor the catalogue knows" in said) is asked and ("--law-from-data" in said) is not asked
    assert ("none explains what is left" in said) is (asked and unused)
    assert ("No effect of the catalogue makes it better" in none) is (asked and unused)
    assert ("was kept unused" in said) is not unused
    for part in ("holds on unused runs", "None of these explains", "worse on unused runs",
                 "judged on unused runs", "0.16 (1.03×)"):  # fmt: skip
        assert (part in said) is unused
    assert unused or ("0.17 (1.10×)" in said and "worse on fitted runs" in said)


def test_an_element_of_a_place_is_named_wherever_the_place_is() -> None:
    shown = material("unexplained")
    curves = [{**PLACE["curves"][0], "explained": 0.9}]
    place = {**PLACE, "component": "arm", "port": "joint", "element": "2", "curves": curves}
    text = Marked(rendered(replace(shown, table={**shown.table, "localisation": [place]}))).text
    assert "An unknown input at arm.joint[2], free in its course" in " ".join(text.split())


def test_clocks_that_were_estimated_are_told() -> None:
    shown = material("effect_found")
    assert "Clocks that were estimated" not in rendered(shown)
    late = {"value": 0.3014, "ci95": [0.2991, 0.3035], "unit": "s", "identifiable": True,
            "at_bound": False}  # fmt: skip
    content = dict(shown.table) | {"clocks": {"camera_late": late}}
    found = Marked(rendered(replace(shown, table=content)))
    assert "camera_late" in found.text
    assert found.facts["value: clocks > camera_late"] == ["0.3014 s"]
    assert found.facts["interval: clocks > camera_late"] == ["0.2991 to 0.3035"]


def test_every_effect_has_advice_and_no_advice_is_for_nothing() -> None:
    known = tomllib.loads(ADVICE.read_text("utf-8"))
    asked = {name for name, module in effects().items() if not module.EFFECT.probe}
    # a fidelity that is looked for like an effect, and what only columns of a log have
    assert set(known) == asked | {"elastic"} | set(READS)
    for name, entry in known.items():
        assert set(entry) == {"means", "check"}, name
        assert all(text.endswith(".") and len(text) < 260 for text in entry.values()), name


def test_places_and_effects_are_put_in_words() -> None:
    assert place_in_words("load.flange") == "the flange of the load"
    assert place_in_words("base.left.axle") == "the axle of left of the base"
    assert place_in_words("gearbox") == "the gearbox"
    assert (
        inside("Coulomb friction.") == "Coulomb friction" and inside("Play in it.") == "play in it"
    )


def test_a_page_asks_for_nothing_outside_itself() -> None:
    html = rendered(material("effect_found"))
    outside = re.findall(r'(?:src|href|url\()\s*=?\s*["\'(]?(?:https?:|//)[^"\' )]*', html)
    assert outside == []
    assert "<script src" not in html and "@import" not in html


def test_names_from_outside_cannot_break_the_page(tmp_path: Path) -> None:
    shown = material("nothing_missing")
    content = dict(shown.table) | {"dataset": "</title><script>alert(1)</script>"}
    channels = (shown.channels[0], replace(shown.channels[1], name="a</script>b"))
    content["channels"] = {"speed": content["channels"]["speed"]}
    html = rendered(replace(shown, table=content, channels=channels))
    assert "<script>alert" not in html and "a</script>b" not in html


def test_the_page_is_written_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pages, "collected", lambda result: material("nothing_missing"))
    pages.write_page(None, tmp_path / "report.html")  # type: ignore[arg-type]
    assert (tmp_path / "report.html").read_text("utf-8").endswith("</html>\n")
