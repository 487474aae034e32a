"""Figures that scenarios choose: measured beside modelled, errors below, several runs in one."""

from __future__ import annotations

from pathlib import Path

import pytest
from matplotlib.image import imread

from cosim.errors import ScenarioError
from cosim.running.figures import draw, figures
from cosim.running.runner import run_scenario
from cosim.scenario.scenario import read_scenario
from tests.scenarios.running import PROVIDER

SCENARIO = """
description = "Crawler on a circle."
system = "crawler"
duration = 2.0
step = 0.02

[inputs]
"crawler.w2" = 2.0

[compare.way]
signal = "crawler.x_S"
times = [0.0, 1.0, 2.0]
values = [-0.08, 0.0, 0.05]
unit = "m"
name = "measured"

[runs.slow.inputs]
"crawler.w3" = 1.0

[runs.spot.inputs]
"crawler.w3" = -2.0

[[runs.slow.checks]]
name = "turns"
quantity = "yaw"
signal = "crawler.beta"
of = "final"
limit = 9.0
source = "any"
"""
FIGURES = """
[[figures]]
name = "poses"
columns = 2
errors = true
plots = [
  { label = "x", signals = ["crawler.x_S"], error_unit = "mm" },
  { label = "y", signals = ["crawler.y_S"] },
]

[[figures]]
name = "paths"
together = true
plots = [ { label = "paths", paths = [["crawler.x_S", "crawler.y_S"]] } ]
"""


def scenario(folder: Path, text: str) -> Path:
    path = folder / "turn" / "scenario.toml"
    path.parent.mkdir(parents=True)
    path.write_text(text)
    return path


def test_one_picture_for_each_run_and_one_for_all(tmp_path: Path) -> None:
    path = scenario(tmp_path, SCENARIO + FIGURES)
    written = figures([str(path)], PROVIDER, tmp_path / "out")
    names = ["turn_poses_slow.png", "turn_poses_spot.png", "turn_paths.png"]
    assert [item.name for item in written] == names
    assert all(imread(item).std() > 0.01 for item in written)  # not one colour


def test_errors_stand_below_what_is_measured_and_only_there(tmp_path: Path) -> None:
    path = scenario(tmp_path, SCENARIO + FIGURES)
    result = run_scenario(read_scenario(path).scenario("slow"), PROVIDER)
    compared, error, plain = draw(0, {"slow": result}, "title").axes
    assert [line.get_label() for line in compared.lines] == ["measured", "crawler.x_S"]
    assert error.get_ylabel() == "error [mm]"
    # what is drawn is the comparison, in its unit
    off = error.lines[0].get_ydata()
    assert off == pytest.approx(1e3 * result.comparisons["way"].differences)
    assert [line.get_label() for line in plain.lines] == ["crawler.y_S"]
    plain_only = FIGURES.replace("errors = true", "")
    without = scenario(tmp_path / "without", SCENARIO + plain_only)
    result = run_scenario(read_scenario(without).scenario("slow"), PROVIDER)
    assert len(draw(0, {"slow": result}, "title").axes) == 2


def test_quantities_of_checks_are_drawn_over_runs(tmp_path: Path) -> None:
    more = '\n[[figures]]\nname = "yaw"\nruns = ["slow"]\nquantities = ["yaw"]\n'
    (path,) = figures([str(scenario(tmp_path, SCENARIO + more))], PROVIDER, tmp_path / "out")
    assert path.name == "turn_yaw.png"


@pytest.mark.parametrize(
    ("more", "text"),
    [
        ("", r"turn.scenario.toml: chooses no figures; write \[\[figures\]\]"),
        ('[[figures]]\nname = "a"\nquantities = ["yow"]\n', r"no check .* 'yow'; .*'yaw'"),
        ('[[figures]]\nname = "a"\n', r"figure 'a': give plots .* or quantities"),
        ('[[figures]]\nname = "a/b"\nquantities = ["yaw"]\n', r"without slashes, not 'a/b'"),
        ('[[figures]]\nname = "a"\nruns = ["slowly"]\nquantities = ["yaw"]\n',
         r"figure 'a': .*'slow'.* not 'slowly'"),
        ('[[figures]]\nname = "a"\ncolumns = 1.5\nplots = [{ label = "x", signals = ["b.x"] }]\n',
         r"columns is 1.5; give a whole number"),
        ('[[figures]]\nname = "a"\nplots = [{ label = "x", comparisons = ["wy"] }]\n',
         r"there is no comparison 'wy'"),
        ('[[figures]]\nname = "a"\nplot = []\n', r"figure 'a' has no key 'plot'; .*'plots'"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_figure_is_said(more: str, text: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=text):
        figures([str(scenario(tmp_path, SCENARIO + more))], PROVIDER, tmp_path / "out")
