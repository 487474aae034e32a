"""Logs that hold several runs, windows of long ones, and poses seen from where a window begins."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks.real_logs import ends
from cosim.calibrate import Problem, read_problem
from cosim.errors import ScenarioError
from tests.problems import simulator

HEAD = """
system = "system.toml"
step = 0.05
time = "t"
relative = [["x", "y", "yaw"]]

[inputs]
"base.w_l" = { column = "left", interpolation = "linear" }
"base.w_r" = { column = "right", interpolation = "linear" }

[channels]
x = { signal = "base.x", sigma = 0.01, unit = "m" }
y = { signal = "base.y", sigma = 0.01, unit = "m" }
yaw = { signal = "base.phi", sigma = 0.01, unit = "rad" }

[[parameter]]
name = "track"
unit = "m"
nominal = 0.25
min = 0.2
max = 0.3
targets = "base.track"

[[run]]
name = "one"
file = "one.npz"
purpose = "identification"
"""
TIMES = np.arange(401) * 0.05
LEFT, RIGHT = np.full(TIMES.shape, 0.1), np.full(TIMES.shape, 0.2)
V, RATE = 0.15, 0.1 / 0.235  # of these wheel speeds, track 0.235 m


def circle(times: np.ndarray, heading: float = 0.7) -> dict[str, np.ndarray]:
    """The exact pose of a base that drives a circle, seen from anywhere."""
    yaw = heading + RATE * times
    x, y = np.sin(yaw) * V / RATE, -np.cos(yaw) * V / RATE
    return {"x": 3.0 + x, "y": -1.0 + y, "yaw": yaw}


def problem_of(folder: Path, text: str, **content: np.ndarray) -> Problem:
    np.savez(folder / "one.npz", **content)
    (folder / "dataset.toml").write_text(text)
    (folder / "system.toml").write_text(
        'description = "Base."\n[instances]\nbase = "diff_drive.neato/rolling"\n'
    )
    return read_problem(folder)


def worst(problem: Problem) -> float:
    """Largest residual over sigma with the true track."""
    found = simulator(problem).residuals(np.array([0.235]), None)
    return max(float(np.nanmax(np.abs(values))) for _, values in found)


def test_windows_begin_at_the_measured_pose(tmp_path: Path) -> None:
    log = {"t": 7.0 + TIMES, "left": LEFT, "right": RIGHT, **circle(TIMES)}
    log["x"][:3] = np.nan  # the first window begins before the pose is seen
    problem = problem_of(tmp_path, HEAD + "window = 5.0\n", **log)
    assert [run.name for run in problem.runs] == ["one 0", "one 1", "one 2", "one 3"]
    assert problem.run("one 0").anchor == 3 and problem.run("one 1").anchor == 0
    np.testing.assert_array_equal(problem.run("one 1").data[0], 0.0)
    assert problem.run("one 2").times[-1] == pytest.approx(5.0)
    # 1e-5 sigma is 0.1 um over 0.75 m: the solver's error on a circle is smaller
    assert worst(problem) < 1e-5
    found = ends(simulator(problem), np.array([0.25]), {"position": ["x", "y"], "yaw": "yaw"})
    error = found["one (identification)"]
    assert error.shape == (4, 3)
    # a track of 0.25 m instead of 0.235 m turns by 5 s * 0.1 m/s * (1/0.235 - 1/0.25) too little
    np.testing.assert_allclose(error[1:, 2], 0.5 / 0.235 - 0.5 / 0.25, rtol=1e-9)
    np.testing.assert_array_equal(error, found["all (identification)"])


def test_commands_before_a_window_count_in_it(tmp_path: Path) -> None:
    # the base stands until 5 s; with 1 s of lead a window sees what was told before it
    left = np.where(TIMES < 4.5, 0.0, LEFT)
    log = {"t": TIMES, "left": left, "right": left, **circle(TIMES)}
    problem = problem_of(tmp_path, "lead = 1.0\n" + HEAD + "window = 5.0\n", **log)
    run = problem.run("one 1")
    assert run.lead == 1.0 and run.times[0] == pytest.approx(1.0)
    told = np.asarray(run.inputs["base.w_l"].at(np.array([0.0, 0.4, 0.5, 1.0])))
    np.testing.assert_allclose(told, [0.0, 0.0, 0.1, 0.1], atol=1e-12)  # linear, on the samples


def test_rows_prefixes_and_values_are_runs(tmp_path: Path) -> None:
    short = TIMES[:60]
    rows = {name: np.tile(values, (4, 1)) for name, values in circle(short).items()}
    rows |= {"left": np.tile(LEFT[:60], (4, 1)), "right": np.tile(RIGHT[:60], (4, 1))}
    text = HEAD.replace('time = "t"\n', "")
    entry = 'rows = true\ninterval = 0.05\nwhere = { step = "odd", good = 1 }\n'
    problem = problem_of(
        tmp_path, text + entry, **rows, step=np.array([0, 1, 1, 3]), good=np.array([1, 1, 0, 1])
    )
    assert [run.name for run in problem.runs] == ["one 1", "one 3"]
    assert problem.run("one 3").values["step"] == 3.0
    assert worst(problem) < 1e-5  # as above

    long = {name: np.concatenate([values, values]) for name, values in circle(short).items()}
    long |= {"t": np.concatenate([short, short]), "run": np.repeat([4, 5], 60),
             "left": np.tile(LEFT[:60], 2), "right": np.tile(RIGHT[:60], 2)}  # fmt: skip
    problem = problem_of(tmp_path, HEAD + 'each = "run"\nwhere = { run = [5, 6] }\n', **long)
    assert [run.name for run in problem.runs] == ["one 5"]
    assert worst(problem) < 1e-5

    ended = circle(short)
    ends_of = {"a_start": np.array([ended[k][0] for k in ("x", "y", "yaw")]),
               "a_final": np.array([ended[k][-1] + (k == "yaw") * 2 * np.pi
                                    for k in ("x", "y", "yaw")])}  # fmt: skip
    columns = '[columns]\nleft = { limit = 0.5, gap = 1.0 }\n' + "".join(
        f'{name} = {{ ends = ["start[{i}]", "final[{i}]"]{wrap} }}\n'
        for i, (name, wrap) in enumerate((("x", ""), ("y", ""), ("yaw", ", unwrap = true")))
    )  # fmt: skip
    jumping = LEFT[:60].copy()
    jumping[[20, 21]] = 300.0, -300.0
    problem = problem_of(
        tmp_path, HEAD + 'prefix = "a_"\n' + columns, a_t=short, a_left=jumping,
        a_right=RIGHT[:60], **ends_of,
    )  # fmt: skip
    assert np.isfinite(problem.runs[0].data).all(axis=1).tolist() == [True, *[False] * 58, True]
    assert worst(problem) < 1e-5


def test_a_clock_of_its_own_is_brought_to_a_grid(tmp_path: Path) -> None:
    own = np.linspace(0.0, 20.0, 3001)
    told = np.where(own < 9.99, 0.1, 0.2)
    text = HEAD.replace("relative", "resample = 0.05\nrelative") + (
        '[columns]\nleft = { time = "t_own", hold = true }\nright = { time = "t_own" }\n'
        "x = { gap = 1.0 }\ny = { gap = 1.0 }\nyaw = { unwrap = true }\n"
    )
    seen = circle(TIMES)
    kept = (TIMES < 3.0) | (TIMES > 3.5)
    log = {name: values[kept] for name, values in seen.items()}
    problem = problem_of(tmp_path, text, t=TIMES[kept], t_own=own, left=told, right=told, **log)
    data = problem.runs[0].data
    assert data.shape[0] == TIMES.size
    missing = ~np.isfinite(data)
    assert not missing[:, :2].any() and missing[:, 2].sum() >= 9  # yaw bridges no gap
    left = np.asarray(problem.runs[0].inputs["base.w_l"].at(np.array([9.95, 10.0])))
    np.testing.assert_array_equal(left, [0.1, 0.2])  # held: no value in between


def several(ids: list[float]) -> dict[str, np.ndarray]:
    """A log of runs of 60 samples with these numbers."""
    short = TIMES[:60]
    whole = {"t": short, "left": LEFT[:60], "right": RIGHT[:60], **circle(short)}
    return {name: np.tile(values, len(ids)) for name, values in whole.items()} | {
        "run": np.repeat(ids, 60)
    }


@pytest.mark.parametrize("ids", [[20240701, 20240702], [0.5, 0.5000001], [2**60, 2**60 + 1]])
def test_each_number_is_a_run_however_long_it_is(tmp_path: Path, ids: list[float]) -> None:
    problem = problem_of(tmp_path, HEAD + 'each = "run"\n', **several(ids))
    assert [run.name for run in problem.runs] == [f"one {one}" for one in ids]
    assert {run.times.size for run in problem.runs} == {60}
    text = HEAD + f'each = "run"\nwhere = {{ run = {ids[1]} }}\n'
    assert [run.name for run in problem_of(tmp_path, text, **several(ids)).runs] == [
        f"one {ids[1]}"
    ]


def test_two_runs_of_one_name_are_refused(tmp_path: Path) -> None:
    other = '[[run]]\nname = "one 1"\nfile = "one.npz"\npurpose = "validation"\n'
    with pytest.raises(ScenarioError, match="two runs are named 'one 1'"):
        problem_of(tmp_path, HEAD + 'each = "run"\n' + other, **several([1]))


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ('prefix = "b_"', "no column begins with 'b_'"),
        ("rows = true", "rows need the interval"),
        ('rows = true\neach = "run"', "rows and each exclude each other"),
        ('each = "left"\nwhere = { good = 1 }', "where names 'good'"),
        ("[columns]\nyaw = { ends = ['start[7]', 'final[0]'] }", "start has 1 values, none at 7"),
        ("[columns]\nyaw = { ends = ['start'] }", "ends must be a list of 2, not ['start']"),
    ],
)
def test_entries_that_do_not_fit_are_named(tmp_path: Path, entry: str, message: str) -> None:
    log = {"t": TIMES, "left": LEFT, "right": RIGHT, "start": np.zeros(1), **circle(TIMES)}
    with pytest.raises(ScenarioError, match=re.escape(message)):
        problem_of(tmp_path, HEAD + entry + "\n", **log)


def test_a_pose_that_is_never_seen_whole_is_named(tmp_path: Path) -> None:
    log = {"t": TIMES, "left": LEFT, "right": RIGHT, **circle(TIMES)}
    log["x"][:] = np.nan
    with pytest.raises(ScenarioError, match="x, y, yaw are never measured together"):
        problem_of(tmp_path, HEAD, **log)


def test_a_counter_that_begins_anew_is_counted_on(tmp_path: Path) -> None:
    log = {"t": TIMES, "left": LEFT, "right": np.mod(250.0 * RIGHT * TIMES, 8.0), **circle(TIMES)}
    text = HEAD.replace('column = "right", interpolation = "linear"',
                        'column = "right", interpolation = "slope"')  # fmt: skip
    text += "[columns]\nright = { unwrap = 8, scale = 0.004 }\n"
    # counts are exact here, so the speed is: residuals as small as those of the exact speeds
    assert worst(problem_of(tmp_path, text, **log)) < 1e-5


def test_the_yaw_of_a_quaternion_and_a_mapping_on_another(tmp_path: Path) -> None:
    log = {"t": TIMES, "left": LEFT, "right": RIGHT, **circle(TIMES, heading=2.9)}
    yaw = log.pop("yaw")
    tilt = 0.3  # about the world's x axis, before the yaw: does not change it
    log["q"] = np.column_stack([np.cos(yaw / 2) * np.sin(tilt / 2), np.sin(yaw / 2)
                                * np.sin(tilt / 2), np.sin(yaw / 2) * np.cos(tilt / 2),
                                np.cos(yaw / 2) * np.cos(tilt / 2)])  # fmt: skip
    (tmp_path / "first.toml").write_text(HEAD.replace("step = 0.05", "step = 0.01"))
    text = 'base = "first.toml"\nstep = 0.05\n[columns]\n' + (
        'yaw = { quaternion = ["q_1", "q_2", "q_3", "q_4"], unwrap = true }\n'
    )
    problem = problem_of(tmp_path, text, **log)
    assert problem.step == 0.05
    assert worst(problem) < 1e-5  # as above


def test_a_run_that_is_shorter_than_its_window_is_refused(tmp_path: Path) -> None:
    wheels = {"t": TIMES, "left": LEFT, "right": RIGHT, **circle(TIMES)}
    assert len(problem_of(tmp_path, HEAD + "window = 20.0\n", **wheels).runs) == 1
    with pytest.raises(ScenarioError, match=r"'one' lasts 20 s, less than its window of 20\.1 s"):
        problem_of(tmp_path, HEAD + "window = 20.1\n", **wheels)
