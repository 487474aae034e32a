"""Runs of a base with two wheels that was placed by hand, and what only looks like that."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from cosim.calibrate import read_problem
from cosim.calibrate.calibration import calibrated
from cosim.calibrate.checks.begun import check_begun
from cosim.calibrate.checks.finding import Finding
from cosim.calibrate.estimate import Estimate
from tests.problems import simulator

RADIUS, TRACK, STEP = 0.0334, 0.166, 0.02
NOISE = (0.002, 0.002, 0.004)
MAPPING = """
system = "system.toml"
step = 0.01
algorithm = "gauss_seidel"
time = "t"
[inputs]
"base.w_l" = "left"
"base.w_r" = "right"
[channels]
x = { signal = "base.x", sigma = 0.002 }
y = { signal = "base.y", sigma = 0.002 }
yaw = { signal = "base.phi", sigma = 0.004 }
[[parameter]]
name = "r"
unit = "m"
nominal = 0.033
min = 0.02
max = 0.05
targets = "base.r"
[[parameter]]
name = "track"
unit = "m"
nominal = 0.16
min = 0.1
max = 0.25
targets = "base.track"
"""
HEADING = """
[[nuisance]]
name = "heading"
unit = "rad"
nominal = 0.0
span = 0.06
per_run = true
targets = "base.pose_phi"
"""


class Wrong(NamedTuple):
    """What a run has that the model does not know.

    Attributes:
        pose: where it begins.
        drift: of the measured heading [rad/s].
        zero: of the measured heading [rad].
        larger: share by which the left wheel is.
    """

    pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    drift: float = 0.0
    zero: float = 0.0
    larger: float = 0.0


def rows(seed: int, wrong: Wrong) -> np.ndarray:
    """Time, wheel speeds and pose of a run, by exact arcs."""
    random = np.random.default_rng(seed)
    count = 400
    wheels = np.repeat(random.uniform(1.0, 9.0, (count // 50, 2)), 50, axis=0)
    pose, found = np.array(wrong.pose), []
    for left, right in wheels:
        found.append(pose)
        first, second = RADIUS * (1.0 + wrong.larger) * left, RADIUS * right
        v, w = 0.5 * (first + second), (second - first) / TRACK
        turn = 0.5 * w * STEP
        chord = v * STEP * np.sinc(turn / np.pi)
        ahead = pose[2] + turn
        pose = pose + np.array([chord * np.cos(ahead), chord * np.sin(ahead), w * STEP])
    times = np.arange(count) * STEP
    logged = np.array(found) + NOISE * random.standard_normal((count, 3))
    logged[:, 2] += wrong.zero + wrong.drift * times
    return np.column_stack([times, wheels, logged])


def estimated(folder: Path, runs: Sequence[Wrong], more: str = "") -> Estimate:
    """The measures of the base from these runs."""
    (folder / "system.toml").write_text(
        'description = "Two wheels."\n[instances]\nbase = "diff_drive/rolling"\n'
    )
    table = MAPPING + more
    for k, wrong in enumerate(runs):
        np.savetxt(folder / f"r{k}.csv", rows(k, wrong), delimiter=",",
                   header="t,left,right,x,y,yaw", comments="")  # fmt: skip
        table += f'[[run]]\nname = "r{k}"\nfile = "r{k}.csv"\npurpose = "identification"\n'
    (folder / "dataset.toml").write_text(table)
    return calibrated(simulator(read_problem(folder)))[0]


def found(folder: Path, runs: Sequence[Wrong], more: str = "") -> list[Finding]:
    return list(check_begun(estimated(folder, runs, more)))


PLACED = [Wrong((0.0, 0.0, angle)) for angle in (0.012, -0.008, 0.004)]


def test_headings_placed_by_hand_are_said_with_the_way_out(tmp_path: Path) -> None:
    """Three sigma and less of the noise of one sample: no first sample shows it."""
    [finding] = found(tmp_path, PLACED)
    assert (finding.severity, finding.kind) == ("error", "start")
    assert "base.pose_phi 0.01" in finding.text
    assert "instead of 0 in r0, and less so in 2 more" in finding.text
    assert 'a [[nuisance]] with targets = "base.pose_phi", nominal = 0' in finding.text
    assert "pose_x" not in finding.text


def test_the_way_out_gives_intervals_with_the_truth(tmp_path: Path) -> None:
    """And nothing more to say."""
    estimate = estimated(tmp_path, PLACED, HEADING)
    assert list(check_begun(estimate)) == []
    for name, truth in (("r", RADIUS), ("track", TRACK)):
        k = estimate.problem.index(name)
        # three deviations: seeds were not chosen
        assert abs(estimate.theta[k] - truth) < 3.0 * estimate.deviation[k]
    for k, wrong in enumerate(PLACED):
        value = estimate.values[f"heading@r{k}"]
        assert value == pytest.approx(wrong.pose[2], abs=1e-3)  # five deviations


def test_places_that_are_off_are_named_beside_headings(tmp_path: Path) -> None:
    places = [Wrong((0.005, 0.0, 0.01)), Wrong((-0.004, 0.0, 0.0)), Wrong((0.0, 0.0, -0.008))]
    [finding] = found(tmp_path, places)
    assert "base.pose_x" in finding.text
    assert "base.pose_phi" in finding.text


def test_a_frame_that_is_turned_is_no_zero_of_a_sensor(tmp_path: Path) -> None:
    """All runs alike: where the path turns with it, laws of the base would be made up for it."""
    [finding] = found(tmp_path, [Wrong((0.0, 0.0, 0.012))] * 3)
    assert finding.severity == "error"
    assert "zero of a sensor" not in finding.text


def test_what_only_adds_a_constant_may_be_a_sensors_zero(tmp_path: Path) -> None:
    [finding] = found(tmp_path, [Wrong((0.004, 0.0, 0.0))] * 3)
    assert finding.severity == "warning"
    assert "or it is the zero of a sensor" in finding.text


@pytest.mark.parametrize(
    "runs",
    [
        [Wrong()] * 3,
        [Wrong(drift=rate) for rate in (0.004, -0.003, 0.002)],
        [Wrong(zero=0.02)] * 3,
        [Wrong(larger=0.01)] * 3,
    ],
    ids=["clean", "a gyro that drifts", "the zero of the heading alone", "unequal wheels"],
)
def test_what_is_no_other_beginning_is_not_called_one(tmp_path: Path, runs: list[Wrong]) -> None:
    assert found(tmp_path, runs) == []
