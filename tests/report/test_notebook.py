"""Results show themselves in a notebook: HTML without scripts, figures as they are."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from cosim import Recording
from cosim.calibrate.checks.finding import Finding
from cosim.calibrate.mapping import read_problem
from cosim.data.comparison import Reference, compare
from cosim.diagnose.diagnosis import Diagnosis
from cosim.display.chart import POINTS, Line, lines, thinned
from tests.report.marked import Marked

DATA = Path(__file__).parents[2] / "scenarios/motor_bench/data/MB-12"


def recording(count: int = 3, error: str = "") -> Recording:
    time = np.linspace(0.0, 2.0, 201)
    names = tuple(f"motor.w_{k}<&" for k in range(count))
    values = np.column_stack([np.sin(time + k) for k in range(count)])
    return Recording(time, values, names, dict.fromkeys(names, "rad/s"), {"scenario": "bench"},
                     {"a -- b": 0.25}, {"a -- b": 2.0}, error)  # fmt: skip


def test_a_recording_draws_its_signals_and_says_how_long_it_is() -> None:
    html = recording()._repr_html_()
    text = Marked(html).text
    for part in ("bench", "3 signals, 201 times to 2 s", "0.25 J", "motor.w_2<&", "[rad/s]"):
        assert part in text
    assert html.count("<polyline") == 3 and "<script" not in html and "stopped" not in text
    assert "stopped: broke" in Marked(recording(error="broke")._repr_html_()).text


def test_a_wide_recording_shows_some_and_says_how_many_more() -> None:
    html = recording(20)._repr_html_()
    assert html.count("<polyline") == 8 and "and 12 more" in html
    empty = Recording(np.zeros(0), np.zeros((0, 0)), (), {})
    assert "0 signals, 0 times to empty" in Marked(empty._repr_html_()).text


def test_a_comparison_gives_its_figures() -> None:
    found = recording(1)
    reference = Reference((found.names[0],), found.time, found.values + 0.125, "rad/s", "log A")
    shown = Marked(compare(found, reference)._repr_html_()).text
    assert "against log A" in shown and "201 samples" in shown and "0.125 rad/s" in shown


def test_a_finding_and_a_refused_diagnosis_show_what_is_wrong() -> None:
    finding = Finding("error", "spikes", "ST1", "current", "has 3 <single> samples that stand out")
    assert "<single>" in Marked(finding._repr_html_()).text
    result = Diagnosis(read_problem(DATA), "bad_data", str(finding), findings=[finding])
    text = Marked(result._repr_html_()).text
    assert "The data cannot be used" in text and "Run ST1, current: has 3 <single> samples" in text


def test_a_system_is_a_drawing_in_which_marked_boxes_stand_out() -> None:
    system = read_problem(DATA).plain()
    plain, marked = system._repr_svg_(), system.svg({"load": ["1", "A"], "motor": ["?"]})

    def texts(drawn: str, kind: str) -> list[str]:
        return [i.text or "" for i in ET.fromstring(drawn).iter() if i.get("class") == kind]

    assert texts(plain, "count") == texts(plain, "halo") == []
    assert sorted(texts(marked, "count")) == ["1", "?", "A"] and len(texts(marked, "halo")) == 2
    # a mark moves nothing
    assert texts(plain, "title") == texts(marked, "title")


def test_a_long_line_keeps_its_peaks_and_an_empty_one_is_nothing() -> None:
    values = np.zeros(50_000)
    values[[12_345, 40_000]] = 5.0, -7.0
    short = thinned(Line("y", np.arange(values.size, dtype=float), values))
    assert short.x.size <= POINTS and short.y.max() == 5.0 and short.y.min() == -7.0
    assert lines([Line("y", np.zeros(0), np.zeros(0))], title="t") == ""
