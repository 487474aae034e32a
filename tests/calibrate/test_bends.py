"""Where the model bends over the steps of its differences, but does not jump, intervals hold."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate import read_problem
from cosim.calibrate.fit import fit
from tests.problems import simulator

STEP, SIZE, RADIUS, TRACK = 0.02, 1000, 0.05, 0.2
NOISE = np.array([0.002, 0.002, 0.003])
MAPPING = """
system = "system.toml"
step = 0.02
[inputs]
"base.w_l" = "left"
"base.w_r" = "right"
[channels]
x = { signal = "base.x", sigma = 0.002 }
y = { signal = "base.y", sigma = 0.002 }
yaw = { signal = "base.phi", sigma = 0.003 }
[[run]]
name = "one"
file = "one.npz"
purpose = "identification"
"""
PARAMETER = """
[[parameter]]
name = "{0}"
unit = "m"
nominal = {1}
min = {2}
max = {3}
targets = "base.{0}"
"""
START = """
[[nuisance]]
name = "start of {0}"
unit = "{1}"
per_run = true
nominal = "first:{0}"
span = 0.05
targets = "base.pose_{2}"
"""


def driven(seed: int) -> dict[str, np.ndarray]:
    """Poses of a base with two wheels whose speeds are drawn each second: arcs, exactly."""
    random = np.random.default_rng(seed)
    left, right = np.repeat(random.uniform(-6.0, 6.0, (2, SIZE // 50)), 50, axis=1)
    speed, turn = 0.5 * RADIUS * (left + right), RADIUS * (right - left) / TRACK
    yaw = np.cumsum(np.append(0.0, turn * STEP))
    middle, half = 0.5 * (yaw[1:] + yaw[:-1]), 0.5 * turn * STEP
    chord = speed * STEP * np.sinc(half / np.pi)
    moved = np.cumsum([chord * np.cos(middle), chord * np.sin(middle)], axis=1)
    x, y = np.concatenate([np.zeros((2, 1)), moved[:, :-1]], axis=1)
    poses = np.column_stack([x, y, yaw[:-1]]) + NOISE * random.standard_normal((SIZE, 3))
    columns = [STEP * np.arange(SIZE), left, right, *poses.T]
    return dict(zip(("time", "left", "right", "x", "y", "yaw"), columns, strict=True))


@pytest.mark.slow
def test_what_poses_tell_of_a_base_is_known_though_they_bend(tmp_path: Path) -> None:
    """A hundredth of the radius's span is 5 % of it, over which the path bends by a hundredth.

    Little, but more than what of the radius neither the track nor the start make up for.
    """
    text = MAPPING + PARAMETER.format("r", 0.055, 0.011, 0.275)
    text += PARAMETER.format("track", 0.18, 0.036, 0.9)
    for name, unit, target in (("x", "m", "x"), ("y", "m", "y"), ("yaw", "rad", "phi")):
        text += START.format(name, unit, target)
    (tmp_path / "dataset.toml").write_text(text)
    (tmp_path / "system.toml").write_text('[instances]\nbase = "diff_drive/rolling"\n')
    np.savez(tmp_path / "one.npz", **driven(2))
    found = fit(simulator(read_problem(tmp_path)))
    assert found.identifiable.all()
    # what J^T J of short steps says, to the quantile for 20 blocks; those by blocks may be larger
    flat = found.jacobian[0].values.reshape(-1, found.theta.size)
    half = 2.1 * np.sqrt(np.diag(np.linalg.inv(flat.T @ flat)))[:2]
    low, high = found.low[:2], found.high[:2]
    assert np.all((0.5 * (high - low) > 0.9 * half) & (0.5 * (high - low) < 1.5 * half))
    assert np.all((low < [RADIUS, TRACK]) & (high > [RADIUS, TRACK]))
