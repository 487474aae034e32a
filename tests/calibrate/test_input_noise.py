"""Noise of logged wheel speeds is a random walk of the pose, and residuals are made white."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate import Problem, read_problem
from cosim.calibrate.differences import jacobian
from cosim.calibrate.fit import fit
from cosim.calibrate.input_noise import propagated
from cosim.calibrate.whitening import InputNoise
from cosim.errors import ScenarioError
from cosim.intake.example import NOISE, RADIUS, drive, write_csv
from tests.problems import simulator
from tests.robot_logs import COLUMNS, write_system

SIGMA = 0.1
"""[rad/s] Of a wheel's speed; its random walk turns the robot by 0.017 rad in the end."""
MAPPING = f"""
system = "robot.toml"
step = 0.02
period = 0.02
algorithm = "gauss_seidel"
time = "pose.stamp_ns"
{COLUMNS}[inputs]
"base.w_l" = {{ column = "left" }}
"base.w_r" = {{ column = "right" }}
[parameters]
"base.pose_x" = 1.5
"base.pose_y" = -0.7
"base.pose_phi" = 3.0
[channels]
x = {{ signal = "base.x", sigma = {NOISE[0]} }}
y = {{ signal = "base.y", sigma = {NOISE[1]} }}
yaw = {{ signal = "base.phi", sigma = {NOISE[2]} }}
[[parameter]]
name = "r"
unit = "m"
nominal = {RADIUS}
min = 0.04
max = 0.06
targets = "base.r"
[[run]]
name = "one"
files = {{ cmd = "one_cmd.csv", pose = "one_pose.csv" }}
purpose = "identification"
"""


def logged(folder: Path, seed: int, sigma: float, said: str = "") -> Problem:
    """A robot that moves by exact arcs, with wheel speeds logged with noise; `said` of them."""
    run = drive(seed)
    chance = np.random.default_rng([seed, 1])
    left, right = (v + chance.normal(0.0, sigma, v.size) for v in (run.left, run.right))
    write_csv(replace(run, left=left, right=right), "one", folder)
    write_system(folder)
    mapping = MAPPING
    if said:
        mapping = mapping.replace('"left" }', f'"left", {said} }}')
        mapping = mapping.replace('"right" }', f'"right", {said} }}')
    (folder / "dataset.toml").write_text(mapping)
    return read_problem(folder)


@pytest.mark.slow
def test_estimates_are_as_far_off_as_their_intervals_say(tmp_path: Path) -> None:
    """And without the noise of the inputs they are not: mean squares over the deviation."""
    counted, not_counted, sizes = [], [], []
    for seed in range(6):
        problem = logged(tmp_path, seed, SIGMA, f"sigma = {SIGMA}")
        plain = simulator(problem, 1)
        white, notes = propagated(plain)
        assert {note.column for note in notes} == {"base.w_l", "base.w_r"}
        for one, kept in ((plain, not_counted), (white, counted)):
            estimate = fit(one)
            kept.append((float(estimate.theta[0]) - RADIUS) / float(estimate.deviation[0]))
        sizes.append(float(np.nanmean(estimate.residuals[0][1] ** 2)))
    # 6 squares of a normal deviate: mean 1, deviation 0.6; blocks may only widen intervals
    assert np.mean(np.square(counted)) < 2.8
    assert np.mean(np.square(not_counted)) > 5.0
    # 6 x 900 residuals give 0.02; interpolated responses and bridges may leave a twentieth
    assert np.mean(sizes) == pytest.approx(1.0, abs=0.06)


def test_noise_that_nobody_stated_is_estimated_and_said(tmp_path: Path) -> None:
    problem = logged(tmp_path, 3, SIGMA)
    # 600 samples tell it to a tenth; speeds that jump within a third of the differences add
    for sigma in problem.runs[0].noisy.values():
        assert 0.8 * SIGMA < sigma < 1.6 * SIGMA
    said = [f for f in problem.source.findings if f.kind == "input"]
    assert [f.column for f in said] == ["left", "right"] and "give its sigma" in said[0].text


def test_clean_inputs_change_nothing(tmp_path: Path) -> None:
    problem = logged(tmp_path, 3, 0.0)
    assert set(problem.runs[0].noisy.values()) == {0.0}
    one = simulator(problem, 1)
    assert propagated(one) == (one, [])


def test_residuals_and_derivatives_are_made_white_alike(tmp_path: Path) -> None:
    problem = logged(tmp_path, 3, SIGMA, f"sigma = {SIGMA}")
    plain = simulator(problem, 1)
    white, _ = propagated(plain)
    theta = problem.nominal
    ((_, before),) = plain.residuals(theta)
    ((_, after),) = white.residuals(theta)
    ((_, same),) = white.residuals(theta, plain=True)
    run = white.problem.runs[0]
    assert np.array_equal(before, same, equal_nan=True)
    assert np.array_equal(run.white(before), after, equal_nan=True)
    (slope,), (changed,) = jacobian(plain, theta), jacobian(white, theta)
    assert np.array_equal(run.white(slope.values), changed.values, equal_nan=True)


def test_values_that_one_sample_became_share_its_noise(tmp_path: Path) -> None:
    """Speeds over intervals, held over them or moving within them: the pose walks as far."""
    said, spread = f'interpolation = "window", sigma = {SIGMA}', []
    for step in ("0.02", "0.005"):
        logged(tmp_path, 3, SIGMA, said)
        text = (tmp_path / "dataset.toml").read_text()
        (tmp_path / "dataset.toml").write_text(text.replace("step = 0.02", f"step = {step}"))
        problem = read_problem(tmp_path)
        _, notes = propagated(simulator(problem, 1))
        spread.append([float(note.text.split("up to ")[1].split()[0]) for note in notes])
    # blocks of samples begin elsewhere; parts counted one by one would give a half
    assert spread[1] == pytest.approx(spread[0], rel=0.1)


@pytest.mark.parametrize(("gain", "channel", "other"), [(1.0, 0, 2), (-1.0, 2, 0)])
def test_inputs_that_one_column_drives_share_its_noise(
    tmp_path: Path, gain: float, channel: int, other: int
) -> None:
    """Wheels that err alike move a base ahead and do not turn it; turned round, they turn it."""
    logged(tmp_path, 3, SIGMA, f"sigma = {SIGMA}")
    mapping = tmp_path / "dataset.toml"
    shared = f'column = "left", gain = {gain}'
    mapping.write_text(mapping.read_text().replace('column = "right"', shared))
    white, (note,) = propagated(simulator(read_problem(tmp_path), 1))
    assert note.column == "base.w_l, base.w_r"
    run = white.problem.runs[0]
    assert run.noise is not None
    spread = np.einsum("sck,k->sc", run.noise.basis.astype(np.float64) ** 2, run.noise.variances)
    # float32 beside the other channel
    assert spread[-1, channel] > 0.2 and spread[-1, other] < 1e-6 * spread[-1, channel]


def test_noise_is_counted_where_a_clock_moves_samples_out_of_a_run(tmp_path: Path) -> None:
    logged(tmp_path, 3, SIGMA, f"sigma = {SIGMA}")
    mapping = tmp_path / "dataset.toml"
    plain = mapping.read_text()
    mapping.write_text(plain.replace("[parameters]", '[parameters]\n"clock:x" = 0.1', 1))
    problem = read_problem(tmp_path)
    (run,) = problem.runs
    # samples that nobody has masked
    data = np.where(np.isfinite(run.data), run.data, 0.0)
    _, notes = propagated(simulator(problem.with_data({"one": data}), 1))
    assert [note.column for note in notes] == ["base.w_l", "base.w_r"]


def test_one_direction_is_taken_off_by_its_variance() -> None:
    factors = np.zeros((4, 1, 1))
    factors[:2, 0, 0] = 3.0
    noise = InputNoise.of(factors, np.ones((4, 1)))
    assert noise is not None
    rows = np.array([[1.0], [1.0], [1.0], [np.nan]])
    along = 1.0 / math.sqrt(1.0 + 18.0)  # its variance is 3^2 + 3^2
    # the basis has single precision
    assert noise.white(rows)[:, 0] == pytest.approx(
        [along, along, 1.0, np.nan], rel=1e-6, nan_ok=True
    )
    # of a shorter run the direction has less variance
    assert noise.white(rows[:1])[0, 0] == pytest.approx(1.0 / math.sqrt(10.0), rel=1e-6)
    # a channel that is only looked at stays as it is
    beside = noise.white(np.column_stack([rows, [5.0, 6.0, 7.0, 8.0]]))
    assert np.array_equal(beside[:, :1], noise.white(rows), equal_nan=True)
    assert beside[:, 1].tolist() == [5.0, 6.0, 7.0, 8.0]
    assert InputNoise.of(0.01 * factors, np.ones((4, 1))) is None


def test_a_negative_deviation_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"base\.w_l: sigma .*0 or more"):
        logged(tmp_path, 3, SIGMA, "sigma = -1.0")
