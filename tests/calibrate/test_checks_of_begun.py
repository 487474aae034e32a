"""Machines that begin every run in motion, at one speed: parameters cannot make up for it."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from cosim.calibrate import read_problem
from cosim.calibrate.checks.examine import check_fit, examine
from cosim.calibrate.checks.finding import Finding
from cosim.calibrate.fit import fit
from tests.diagnose import disc
from tests.problems import simulator

SPEED = 2.0
"""A hundred times the noise of a sample [rad/s]."""


def starts(folder: Path) -> list[Finding]:
    """What is said of starts, before a fit and after it."""
    mapping = folder / "dataset.toml"
    text = mapping.read_text(encoding="utf-8")
    # exchanged so often that the step's error is below the noise
    mapping.write_text(text.replace("step = 0.005", "step = 0.0005"), encoding="utf-8")
    made = simulator(read_problem(folder))
    before = [f for f in examine(made) if f.kind == "start"]
    assert before == []  # alike in all runs, it may be a sensor's zero
    return [f for f in check_fit(fit(made)) if f.kind == "start"]


@pytest.mark.parametrize("friction", [0.0, 0.01])
def test_a_speed_that_all_runs_begin_with_is_said_with_its_value(
    tmp_path: Path, friction: float
) -> None:
    """With dry friction that the model lacks, too, what is left is more than noise."""
    folder = disc.write(tmp_path, lambda w, theta, t: friction * math.tanh(w / 0.02), begun=SPEED)
    (error,) = starts(folder)
    assert error.severity == "error" and "load.speed" in error.text
    assert "all runs begin where the model does not" in error.text
    assert ("something else is missing, too" in error.text) == bool(friction)
    if not friction:
        value = float(error.text.split("load.speed ")[1].split()[0])
        # torque acts up to half a step late, which the largest one makes 6e-3 rad/s of
        assert abs(value - SPEED) < 0.01
        moved = error.text.split(", and it moves ")[1].split(", out of")[0]
        values = [float(item.split(" to ")[1].split()[0]) for item in moved.split(", ")]
        assert values == pytest.approx([disc.J, disc.B], rel=0.02)


@pytest.mark.parametrize("friction", [0.0, 0.05])
def test_a_sensors_zero_and_a_law_are_no_other_beginning(tmp_path: Path, friction: float) -> None:
    """The twins: a reading that is off at all times, and friction in runs that begin at rest."""
    zero = 0.0 if friction else SPEED
    law = lambda w, theta, t: friction * math.tanh(w / 0.02)  # noqa: E731
    assert starts(disc.write(tmp_path, law, zero=zero)) == []
