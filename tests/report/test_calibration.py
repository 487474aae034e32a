"""The page of a calibration says what its JSON says, and what to do with it."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from cosim.report.calibration import rendered
from cosim.report.material import Material
from tests import browser
from tests.report.marked import Marked, expected
from tests.report.stories import CHANNELS, runs

BOUNDS = {"R_a": (0.33, 0.37), "eta": (0.78, 0.86)}
VALUES = {"motor.R_a": 0.35802, "gearbox.eta": 0.81297}


def content(error: float = 1.0) -> dict[str, Any]:
    """As of `cosim calibrate --json`."""
    parameter = {"nominal": 0.35, "at_bound": False}
    return {
        "dataset": "MB-99", "system": "motor_bench",
        "parameters": {
            "R_a": {**parameter, "value": 0.35802, "ci95": [0.35695, 0.35909], "unit": "ohm",
                    "identifiable": True},
            "eta": {**parameter, "value": 0.81297, "ci95": [0.78, 0.86], "unit": "-",
                    "identifiable": False},
        },
        "not_separable": ["+0.96*eta +0.29*J"],
        "channels": {
            c.name: {"unit": c.unit, "noise_rms": c.sigma,
                     "identification": 0.99 * error * c.sigma, "validation": error * c.sigma}
            for c in CHANNELS
        },
        "sensitivity": {"local": {"R_a": 1.5, "eta": 0.1}, "correlation": {"R_a": 0.7, "eta": -0.1},
                        "correlation_limit": 0.43},
        "findings": [], "evaluations": 59, "wall_s": 9.0,
    }  # fmt: skip


def page(table: dict[str, Any], scenario: str = "motor_bench") -> str:
    symbols = {"R_a": "armature resistance", "eta": "efficiency"}
    material = Material(table, CHANNELS, runs("nothing_missing"), None, symbols)
    return rendered(material, BOUNDS, VALUES, scenario)


@pytest.mark.parametrize("error", [1.0, 2.5])
def test_sentences_tables_and_json_say_the_same(error: float) -> None:
    table = content(error)
    found = Marked(page(table))
    for fact, texts in found.facts.items():
        assert set(texts) == {expected(table, fact)}, fact
    assert len(found.facts["ratio: channels > speed > validation"]) >= 2
    good = error < 1.1
    assert ("as good as a model can be" in found.text) == good
    assert ("more is missing" in found.text) == ("cosim diagnose" in found.text) == (not good)


def test_what_the_runs_leave_open_is_said_and_a_bound_is_named() -> None:
    text = Marked(page(content())).text
    assert "determine 1 of 2 parameters" in text and "do not determine eta" in text
    assert "+0.96*eta +0.29*J" in text and "ended at a bound" not in text
    table = content()
    table["parameters"]["R_a"]["at_bound"] = True
    assert "R_a ended at a bound" in Marked(page(table)).text


def test_the_values_are_given_as_a_command_where_there_is_a_scenario() -> None:
    text = Marked(page(content())).text
    line = text[text.index("cosim run motor_bench") :].partition("copy")[0]
    assert shlex.split(line)[3:] == [
        "--param", "motor.R_a=0.35802", "--param", "gearbox.eta=0.81297"
    ]  # fmt: skip
    assert "cosim run" not in Marked(page(content(), "")).text


def test_without_random_sets_there_is_no_tornado() -> None:
    assert 'id="tornado"' in page(content())
    table = content()
    table["sensitivity"] |= {"correlation": {}, "correlation_limit": None}
    assert 'id="tornado"' not in page(table)


@pytest.mark.slow
def test_a_browser_draws_it(tmp_path: Path) -> None:
    executable = browser.find()
    if executable is None:
        pytest.skip(f"none of {', '.join(browser.NAMES)} is installed")
    path = tmp_path / "report.html"
    path.write_text(page(content()), "utf-8")
    with browser.browser(executable) as shown:
        for width in (1400, 390):
            shown.open(path, width, 900, mobile=width == 390)
            assert shown.errors == [] and shown.requests == []
            assert shown.run("document.documentElement.scrollWidth") == width
        assert shown.run("plots.length") >= 3
        assert shown.run("[...document.querySelectorAll('svg.bar')].length") == 4


def test_channels_that_were_not_judged_leave_their_cells_empty() -> None:
    table = content()
    for row in table["channels"].values():
        row["validation"] = None
    material = Material(table, CHANNELS, runs("nothing_missing", count=1), None, {})
    fitted = tuple(replace(run, purpose="identification") for run in material.runs)
    text = Marked(rendered(replace(material, runs=fitted), BOUNDS, VALUES, "")).text
    assert "on the fitted runs" in text
