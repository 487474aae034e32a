"""The page of a run says whether its checks are met, and shows what was recorded."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import cosim
from cosim import Recording, Result
from cosim.report.run_page import run_page, write_run_page
from cosim.running.runner import RunResult
from cosim.scenario.checks import CheckResult
from tests import browser
from tests.report.marked import Marked

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def result() -> Iterator[Result]:
    yield cosim.run("motor_bench", duration=2.5)


def text(result: Result) -> str:
    return Marked(run_page(result)).text


def changed(result: Result, **changes: object) -> Result:
    """The first run alone, changed."""
    first: RunResult = result.runs["ST1"]
    return replace(result, runs={"": replace(first, **changes)})  # type: ignore[arg-type]


def check(value: float, ok: bool, unfit: str = "") -> CheckResult:
    return CheckResult("settled", value, 0.17, ok, "noise", value, "rad/s", unfit=unfit)


def test_the_verdict_follows_from_the_checks(result: Result) -> None:
    outcomes = {
        "Its check is met.": (check(0.1, True),),
        "1 of 1 checks failed: settled.": (check(0.3, False),),
        "All 2 checks are met.": (check(0.1, True), check(0.1, True)),
        "None of its 1 checks is judged": (check(0.3, False, "another part"),),
        "It has no checks.": (),
    }
    for said, checks in outcomes.items():
        names = [replace(item, name=f"settled {n}" if n else "settled") for n, item in
                 enumerate(checks)]  # fmt: skip
        shown = text(changed(result, checks=tuple(names)))
        assert [other for other in outcomes if other in shown] == [said]


def test_a_run_that_stopped_says_why(result: Result) -> None:
    broken = replace(result.runs["ST1"].recording, error="motor: not finite at 1.5 s")
    assert "It stopped before its end: motor: not finite" in text(changed(result, recording=broken))
    assert "stopped before" not in text(result)


def test_figures_are_those_of_the_json(result: Result) -> None:
    shown = text(result)
    for name, item in result.to_dict()["comparison"].items():
        assert name.rpartition(": ")[2] in shown
        assert f"{item['rms']:.4g}" in shown and f"{item['max']:.4g}" in shown
    for variant in result.runs["ST1"].variants.values():
        assert variant in shown


@pytest.mark.parametrize("plots", ["", '[[plots]]\nlabel = "speed"\nsignals = ["load.w"]\n'])
def test_two_references_of_one_signal_are_both_drawn(tmp_path: Path, plots: str) -> None:
    place = tmp_path / "scenario.toml"
    place.write_text(
        'system = "motor_bench"\nduration = 0.01\nstep = 1e-3\n' + plots + "".join(
            f'[compare.{name}]\nsignal = "load.w"\nconstant = {value}\nunit = "rad/s"\n'
            for name, value in (("bench_a", 1.0), ("bench_b", 7.0))
        )
    )  # fmt: skip
    result = cosim.run(place)
    lines = [line for axis in result.runs[""].plot().axes for line in axis.get_lines()]
    assert [line.get_ydata()[0] for line in lines if "bench" in line.get_label()] == [1.0, 7.0]
    page = run_page(result)
    kept = json.loads(re.search("id=.signal-data.>(.*?)</script>", page, re.S)[1])  # type: ignore[index]
    for name, value in (("bench_a", 1.0), ("bench_b", 7.0)):
        assert kept[f"/{name}/log"]["low"] == pytest.approx(value, abs=1e-6)  # 16 bits of a span
        assert f"/{name}/log" in page.split("signal-data")[0]


def test_signals_without_a_reference_are_drawn_together_by_unit(result: Result) -> None:
    time = np.linspace(0.0, 1.0, 50)
    names = tuple(f"arm.q[{k}]" for k in range(8))
    recording = Recording(time, np.zeros((50, 8)), names, dict.fromkeys(names, "rad"))
    first: RunResult = result.runs["ST1"]
    item = replace(first.scenario, references={}, checks=())
    alone = replace(first, scenario=item, recording=recording, comparisons={}, checks=())
    html = run_page(replace(result, runs={"": alone}))
    titles = re.findall(r'"title":"([^"]*)"', html)
    assert list(dict.fromkeys(titles)) == ["arm.q[0] and 5 more [rad]", "arm.q[6] and 1 more [rad]"]


def test_a_system_whose_files_have_gone_is_not_drawn_and_it_is_said(result: Result) -> None:
    from cosim.installation.builder import default_provider

    first: RunResult = result.runs["ST1"]
    gone = changed(result, variants={**first.variants, "load": "gone.fmu"})
    html = run_page(gone, default_provider())
    assert "The system is not drawn: " in html and "gone.fmu" in html
    assert "cosim-system" not in html and "cosim-system" in run_page(result, default_provider())


def test_a_browser_draws_it_with_its_system(result: Result, tmp_path: Path) -> None:
    from cosim.installation.builder import default_provider

    executable = browser.find()
    if executable is None:
        pytest.skip(f"none of {', '.join(browser.NAMES)} is installed")
    path = write_run_page(result, default_provider(), tmp_path / "report.html")
    assert path.stat().st_size < 2_000_000
    with browser.browser(executable) as shown:
        for width in (1400, 390):
            shown.open(path, width, 900, mobile=width == 390)
            assert shown.errors == [] and shown.requests == []
            assert shown.run("document.documentElement.scrollWidth") == width
        assert shown.run("plots.every((p) => +p.root.dataset.drawn >= 1)")
        assert shown.run("document.querySelectorAll('svg.cosim-system .box').length") == 4
