"""What checks and comparisons measure is a number of one unit, or refused before the run."""

from __future__ import annotations

from pathlib import Path

import pytest

import cosim
from cosim.errors import InputError, ScenarioError, UnitError

BENCH = """
system = "motor_bench"
duration = 0.01
step = 1e-3
"""
ARM = """
system = "arm.toml"
duration = 0.01
step = 1e-3
"""


def run(folder: Path, text: str, **arguments: object) -> cosim.Result:
    (folder / "arm.toml").write_text(
        'connections = []\n[instances]\npath = "joint_trajectory/quintic"\n'
    )
    path = folder / "scenario.toml"
    path.write_text(text)
    return cosim.run(path, **arguments)  # type: ignore[arg-type]


def check(signals: str, of: str) -> str:
    return f'[[checks]]\nname = "c"\n{signals}\nof = "{of}"\nlimit = 100.0\n'


@pytest.mark.parametrize(
    "text",
    [
        *(check('signal = "path.q_set"', of) for of in ("final", "span")),
        check('signal = "path.q_set[1]"\nminus = "path.q_set"', "mean"),
        '[compare.c]\nsignal = "path.q_set"\ntimes = [0.0]\nvalues = [0.0]\n',
    ],
)
def test_a_vector_is_not_measured_as_a_whole(tmp_path: Path, text: str) -> None:
    with pytest.raises(ScenarioError, match=r"path.q_set is a vector of 6 .* path.q_set\[1\]"):
        run(tmp_path, ARM + text)
    result = run(tmp_path, ARM + text.replace('q_set"', 'q_set[1]"'))
    assert not any(item.failed for item in result.checks.values())


@pytest.mark.parametrize("of", ["path_length", "distance", "circle_radius"])
def test_a_path_is_of_one_unit(tmp_path: Path, of: str) -> None:
    with pytest.raises(UnitError, match=r"check 'c': .* units are rad/s, N.m"):
        run(tmp_path, BENCH + check('signals = ["load.w", "motor.tau"]', of))
    assert run(tmp_path, BENCH + check('signals = ["load.w", "motor.w"]', of)).checks["c"].unit


@pytest.mark.parametrize(
    "text",
    [
        '[compare.c]\nsignals = ["load.w", "motor.tau"]\ntimes = [0.0]\nvalues = [[0.0, 0.0]]\n',
        '[[plots]]\nlabel = "c"\npaths = [["load.w", "motor.tau"]]\n',
    ],
)
def test_other_paths_of_two_units_are_refused_before_the_run(tmp_path: Path, text: str) -> None:
    with pytest.raises(InputError):
        run(tmp_path, BENCH + text, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_what_is_compared_more_often_than_recorded_is_told() -> None:
    def notes(period: float | None) -> list[str]:
        result = cosim.run("motor_bench/ST1", duration=1.0, step=1e-3, record_period=period)
        return [note for note in result.runs[""].notes if "straight lines" in note]

    assert notes(None) == []
    assert notes(1e-3) == []
    (told,) = notes(0.1)
    assert told.startswith("recorded every 0.1 s, and compared every 0.001 s (speed, current")
