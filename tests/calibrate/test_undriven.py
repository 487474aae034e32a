"""Inputs that a mapping forgets, though the log has a column for them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate import read_problem
from cosim.calibrate.checks.finding import Finding
from cosim.calibrate.checks.undriven import used

MAPPING = """
system = "system.toml"
step = 0.01
time = "t"
MORE
[columns]
v_right = { source = "right" }
[inputs]
"base.w_l" = "left"
INPUT
[channels.x]
signal = "base.x"
sigma = 0.01
[[parameter]]
name = "r"
unit = "m"
nominal = 0.05
min = 0.01
max = 0.25
targets = "base.r"
[[run]]
name = "R"
file = "r.csv"
purpose = "identification"
"""
HEADS = "t [s],left [rad/s],right [rad/s],x [m]"


def undriven(folder: Path, given: str = "", more: str = "", heads: str = HEADS) -> list[Finding]:
    """Findings of a base whose right wheel the mapping drives with what is given."""
    times = np.arange(100) * 0.01
    rows = np.column_stack([times, np.sin(times), np.cos(times), times])
    np.savetxt(folder / "r.csv", rows, delimiter=",", header=heads, comments="")
    (folder / "dataset.toml").write_text(MAPPING.replace("INPUT", given).replace("MORE", more))
    (folder / "system.toml").write_text(
        'description = "Two wheels."\nconnections = []\n[instances]\nbase = "diff_drive/rolling"\n'
    )
    return [f for f in read_problem(folder).source.findings if f.kind == "undriven"]


@pytest.mark.parametrize("heads", [HEADS, "t,left,right,x"])
def test_a_forgotten_input_is_named_with_the_column_that_may_be_it(
    tmp_path: Path, heads: str
) -> None:
    """By its unit, or, if the log states none, as the other wheel."""
    [found] = undriven(tmp_path, heads=heads)
    assert (found.severity, found.column) == ("warning", "base.w_r")
    # the start value that sources/diff_drive declares
    assert "it stays at 2 rad/s, though nothing uses right, v_right of the log" in found.text
    assert 'under [inputs] ("base.w_r" = "right")' in found.text
    assert 'under [parameters] ("base.w_r" = 2.0)' in found.text


@pytest.mark.parametrize(
    ("given", "more", "heads"),
    [
        ('"base.w_r" = "right"', "", HEADS),
        ('"base.w_r" = "v_right"', "", HEADS),
        ("", 'parameters = { "base.w_r" = 0.0 }', HEADS),
        # no column is a speed of a wheel
        ("", "", "t [s],left [rad/s],right [N],x [m]"),
        # the column is used, by both
        ('"base.w_r" = "left"', "", HEADS),
    ],
)
def test_an_input_that_is_driven_or_set_or_has_no_column_is_not(
    tmp_path: Path, given: str, more: str, heads: str
) -> None:
    assert undriven(tmp_path, given, more, heads) == []


def test_what_a_mapping_uses_holds_what_its_columns_are_made_of() -> None:
    table = {
        "time": "t",
        "columns": {
            "yaw": {"quaternion": ["a", "b", "c", "d"], "time": "t_pose"},
            "q_1..2": {"source": "deg_{}"},
            "idle": {"source": "spare"},
            "end": {"source": "e", "ends": ["first_e[0]", "e[1]"]},
        },
        "channels": {"yaw": {}, "q_1..2": {}, "tail": {"column": "end"}},
        "inputs": {"drive.u": {"columns": "u_1..2"}, "drive.v": "v"},
        "starts": {"first:x0": "base.x"},
        "nuisance": [{"nominal": "first:y0"}],
    }
    expected = "time t yaw a b c d t_pose q_1 q_2 deg_1 deg_2 end e first_e u_1 u_2 v x0 y0"
    assert used(table) == set(expected.split())
