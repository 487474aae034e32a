"""Runs that begin otherwise than they are said to: bad data, unless one law does as much."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim.calibrate.mapping import read_problem
from cosim.diagnose import diagnose
from tests.placed import Wrong, write

pytestmark = pytest.mark.slow


def test_a_frame_that_is_turned_is_no_law_of_the_base(tmp_path: Path) -> None:
    """It ended with a bias, a dead zone and another bias, each with a narrow interval."""
    runs = [Wrong((0.0, 0.0, 0.012))] * 3
    result = diagnose(read_problem(write(tmp_path, runs, unused=1)))
    assert result.verdict == "bad_data"
    assert "base.pose_phi 0.012" in result.reason
    assert "their frame is turned or moved, as all runs are off alike" in result.reason


def test_one_law_that_does_as_much_is_named(tmp_path: Path) -> None:
    """The twin: a drift of the heading that is read is found beside runs that begin as said."""
    runs = [Wrong(drift=0.004)] * 3
    result = diagnose(read_problem(write(tmp_path, runs, unused=1)))
    assert [law.label for law in result.answer.laws] == ["zero_drift at log.yaw"]
    assert not any("do not begin" in warning for warning in result.warnings)
