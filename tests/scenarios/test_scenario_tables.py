"""Tables, overviews, circles and labelled plots of scenarios."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.data.comparison import circle
from cosim.errors import InputError, ScenarioError
from cosim.running.runner import run
from cosim.scenario.scenario import find
from tests.scenarios.running import PROVIDER

SYSTEM = """
[instances]
path = "pose_trajectory/swing"
"""
SCENARIO = """
description = "circles"
system = "point"
duration = 1.0
step = 0.01
[table]
file = "rows.csv"
name = "r{row}"
[table.columns]
twice = "2 * radius"
rest = "others(radius, group)"
mixed = "sqrt(radius ** 2 + 3) - pi / hypot(3, 4) + min(radius, -radius)"
[parameters]
path.A_x = "{radius}"
[[checks]]
name = "largest x"
quantity = "x"
case = "model"
signal = "path.x_set"
of = "maximum"
expected = "{twice}"
relative = true
limit = 10.0
source = "none"
reference = "twice"
[[checks]]
name = "less itself"
signal = "path.x_set"
minus = "path.x_set"
of = "peak"
limit = 0.0
source = "x - x"
[[checks]]
name = "per two"
signal = "path.thetad_set"
of = "final"
per = 2.0
limit = 10.0
source = "none"
[[plots]]
label = "x less y"
signals = ["path.x_set"]
minus = "path.y_set"
unit = "mm"
[[plots]]
label = "path"
paths = [["path.x_set", "path.y_set"]]
[runs.r2]
parameters.path.A_y = 7.0
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "systems").mkdir()
    (tmp_path / "systems" / "point.toml").write_text(SYSTEM)
    (tmp_path / "points").mkdir()
    (tmp_path / "points" / "scenario.toml").write_text(SCENARIO)
    (tmp_path / "points" / "rows.csv").write_text("row,group,radius\n1,a,1\n2,a,3\n3,a,8\n4,b,5\n")
    return tmp_path


def edit(folder: Path, old: str, new: str) -> None:
    path = folder / "points" / "scenario.toml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def columns(folder: Path, run_name: str) -> dict[str, str]:
    file, _ = find("points", folder)
    row = file.runs[run_name][""]
    assert isinstance(row, dict)
    return row


def test_calculated_columns(folder: Path) -> None:
    edit(folder, 'rest = "others(radius, group)"\n', "")
    row = columns(folder, "r2")
    assert float(row["twice"]) == 6.0
    # exact arithmetic in double precision
    assert float(row["mixed"]) == np.sqrt(12.0) - np.pi / 5.0 - 3.0


def test_mean_of_the_others_of_a_group(folder: Path) -> None:
    path = folder / "points" / "rows.csv"
    path.write_text("row,group,radius\n1,a,1\n2,a,3\n3,a,8\n4,b,5\n5,b,7\n")
    rest = [float(columns(folder, f"r{i}")["rest"]) for i in range(1, 6)]
    assert rest == [5.5, 4.5, 2.0, 7.0, 5.0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("radius +", "is not an expression"),
        ("radios", "nothing is called 'radios'; did you mean 'radius'"),
        ("group", "group is 'a', not a number"),
        ("1 / (radius - radius)", "cannot be calculated"),
        ("__import__('os').getcwd()", "is not understood"),
        ("open(radius)", "is not understood"),
        ("radius.real", "is not understood"),
        ("others(radius, row)", "no other row has row = 1"),
        ("sqrt(radius, radius)", "cannot be calculated"),
    ],
)
def test_expressions_are_arithmetic_and_nothing_else(folder: Path, text: str, message: str) -> None:
    edit(folder, "2 * radius", text)
    with pytest.raises(ScenarioError, match=message.replace("(", r"\(").replace(")", r"\)")):
        find("points", folder)


@pytest.mark.slow
def test_overview_and_files(folder: Path, tmp_path: Path) -> None:
    edit(folder, 'rest = "others(radius, group)"\n', "")
    result = run("points", provider=PROVIDER, folder=folder, out=tmp_path / "out")
    (quantity,) = result.overview
    assert quantity.runs == ("r1", "r2", "r3", "r4") and quantity.reference == "twice"
    assert quantity.marks == {"r1": 2.0, "r2": 6.0, "r3": 16.0, "r4": 10.0}
    head, rows = quantity.rows()
    assert head == ["x [m]", "twice", "model"]
    assert rows[0][:2] == ["r1", "2"] and rows[0][2].endswith("%)")
    assert rows[-1][0] == "rms deviation"
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "r1", "r2", "r3", "r4", "overview.png", "result.json",
    }  # fmt: skip


def test_a_row_may_be_changed_as_a_run(folder: Path) -> None:
    edit(folder, 'rest = "others(radius, group)"\n', "")
    file, _ = find("points", folder)
    assert file.scenario("r2").parameters == {"path.A_x": 3.0, "path.A_y": 7.0}
    assert file.scenario("r3").parameters == {"path.A_x": 8.0}


def test_measures(folder: Path) -> None:
    edit(folder, 'rest = "others(radius, group)"\n', "")
    result = run("points/r1", provider=PROVIDER, folder=folder)
    assert result.checks["less itself"].value == 0.0
    half = result.checks["per two"]
    assert half.measured == result.recording["path.thetad_set"][-1] / 2.0 and half.unit == "1"


def test_plot_has_paths_and_units(folder: Path) -> None:
    edit(folder, 'rest = "others(radius, group)"\n', "")
    figure = run("points/r1", provider=PROVIDER, folder=folder).runs[""].plot()
    labels = [(axes.get_xlabel(), axes.get_ylabel()) for axes in figure.get_axes()]
    assert labels == [("x [m]", "y [m]"), ("time [s]", "x less y [mm]")]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('paths = [["path.x_set", "path.y_set"]]', "", "give signals, or paths"),
        ('minus = "path.y_set"', 'less = "y"', "has no key 'less'"),
        ("per = 2.0", "per = 0.0", "must be positive"),
        ('label = "path"\npaths = [["path.x_set", "path.y_set"]]', 'comparisons = ["c"]',
         "there is no comparison 'c'"),
    ],
)  # fmt: skip
def test_bad_entries(folder: Path, old: str, new: str, message: str) -> None:
    edit(folder, 'rest = "others(radius, group)"\n', "")
    edit(folder, old, new)
    with pytest.raises(InputError, match=message):
        run("points/r1", provider=PROVIDER, folder=folder)


def test_circle() -> None:
    times = np.linspace(0.0, 2.0, 9)
    points = circle(times, [1.0, 2.0], [1.0, 5.0], 0.5)
    # R = 3 about (1, 5), from below, turning left: (1 + 3 sin a, 5 - 3 cos a)
    expected = np.column_stack([1 + 3 * np.sin(0.5 * times), 5 - 3 * np.cos(0.5 * times)])
    np.testing.assert_allclose(points, expected, rtol=0, atol=1e-14)  # rounding
