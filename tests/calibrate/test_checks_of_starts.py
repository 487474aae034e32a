"""Runs that begin elsewhere, and machines that a force holds where the model stands, too."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate import read_problem
from cosim.calibrate.checks.examine import examine
from cosim.calibrate.checks.finding import Finding
from cosim.calibrate.checks.starts import check_starts
from cosim.calibrate.problem import Problem
from tests.diagnose import disc
from tests.problems import simulator

OFF = {"speed": 9.0, "current": 2.0, "voltage": 2.0, "angle": 1.0}
"""Far beyond the noise, and what a quarter of the parameters' bounds changes."""


@pytest.fixture(scope="module")
def standing(short: Problem) -> dict[str, np.ndarray]:
    """Noisy values of the model; the run `stairs` stands for a quarter of a second."""
    random = np.random.default_rng(5)
    values = {run.name: simulator(short).simulate(short.nominal, run) for run in short.runs}
    return {n: v + short.sigma * random.standard_normal(v.shape) for n, v in values.items()}


def found(short: Problem, data: dict[str, np.ndarray]) -> list[Finding]:
    """In these values of the channels."""
    problem = short.changed(runs=[replace(run, data=data[run.name]) for run in short.runs])
    models = {run.name: simulator(short).simulate(short.nominal, run) for run in short.runs}
    return list(check_starts(simulator(problem), models))


@pytest.mark.parametrize("channel", ["current", "voltage"])
def test_what_a_force_holds_at_rest_is_no_other_beginning(
    short: Problem, standing: dict[str, np.ndarray], channel: str
) -> None:
    assert found(short, standing) == []
    k = [c.name for c in short.channels].index(channel)
    held = standing["stairs"].copy()
    held[:, k] += OFF[channel]
    (warning,) = found(short, {**standing, "stairs": held})
    assert (warning.severity, warning.kind, warning.run) == ("warning", "start", "stairs")
    assert (
        f"stands where the model stands, but not with the same effort ({channel} " in warning.text
    )


@pytest.mark.parametrize(
    ("channel", "fades"), [("angle", False), ("speed", False), ("current", True)]
)
def test_another_place_another_speed_and_what_changes_is_one(
    short: Problem, standing: dict[str, np.ndarray], channel: str, fades: bool
) -> None:
    """The twin: a current that is gone before anything moves is what a drive began with."""
    k = [c.name for c in short.channels].index(channel)
    away = standing["stairs"].copy()
    ahead = np.exp(-np.arange(len(away)) / 50.0) if fades else np.ones(len(away))
    away[:, k] += 2.0 * OFF[channel] * ahead
    (error,) = found(short, {**standing, "stairs": away})
    assert (error.severity, error.kind, error.run) == ("error", "start", "stairs")
    assert "begins where the model does not" in error.text


def test_a_run_in_which_the_model_moves_at_once_begins_elsewhere(
    short: Problem, standing: dict[str, np.ndarray]
) -> None:
    k = [c.name for c in short.channels].index("current")
    away = standing["sines"].copy()
    away[:, k] += 2.0 * OFF["current"]
    (error,) = found(short, {**standing, "sines": away})
    assert (error.severity, error.run) == ("error", "sines")


def test_a_speed_that_most_runs_begin_with_is_told_beside_angles_that_differ(
    short: Problem, standing: dict[str, np.ndarray]
) -> None:
    """By itself it might be a sensor's zero; the twin begins where the model does but for that."""
    names = [c.name for c in short.channels]
    moving = {name: values.copy() for name, values in standing.items()}
    for values in moving.values():
        values[:, names.index("speed")] += OFF["speed"]
    assert len(moving) > 2 and found(short, moving) == []
    moving["stairs"][:, names.index("angle")] += 2.0 * OFF["angle"]
    (error,) = found(short, moving)
    means = moving["stairs"][:5].mean(axis=0)
    for name in ("speed", "angle"):
        assert f"{name} {means[names.index(name)]:.4g} instead of " in error.text


@pytest.mark.parametrize(("column", "alone"), [("theta", False), ("w", False), ("w", True)])
def test_a_start_value_with_noise_is_told_where_it_is_felt(
    tmp_path: Path, column: str, alone: bool
) -> None:
    """An angle stays off; a speed fades within a sixth of the run, but the angle drifts with it."""
    folder = disc.write(tmp_path, lambda w, theta, t: 0.0, names=("sweep", "check"))
    mapping = folder / "dataset.toml"
    variable, size = {"theta": ("load.angle", "1"), "w": ("load.speed", "9.3")}[column]
    text = mapping.read_text(encoding="utf-8")
    text = text.replace("[channels.w]\n", '[channels.speed]\ncolumn = "w"\n')
    if alone:  # no angle is measured
        before, _, after = text.partition("[channels.theta]")
        text = before + "[[parameter]]" + after.partition("[[parameter]]")[2]
    entry = f'[starts]\n"first:{column}" = "{variable}"\n\n[columns]'
    mapping.write_text(text.replace("[columns]", entry), encoding="utf-8")
    told = [f.text for f in examine(simulator(read_problem(folder))) if f.kind == "start"]
    assert len(told) == (not alone)
    if told:
        assert f"{variable} begins with the first value of a column whose noise (0.0" in told[0]
        assert f"moves theta by {size} times its own: estimate it" in told[0]
