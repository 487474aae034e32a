"""A base that slips outwards in bends is named so, and not as two clocks that are late."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate.problem import Problem
from cosim.diagnose.candidates import candidates, delays
from cosim.intake.example import FRAME, PERIOD, RADIUS, TRACK, drive
from tests.diagnose.test_late_columns import NAMES, written
from tests.diagnose.test_misread_columns import found

pytestmark = pytest.mark.slow
LAW = "side_slip at base.across"


def slipping(folder: Path, k: float, power: float = 1.0) -> Problem:
    """The robot's runs, moved by what it slips: Euler steps of a tenth of a command."""
    problem, data = written(folder, 0.0), {}
    for seed, name in enumerate(NAMES):
        run, run_of = drive(40 + seed), problem.run(name)
        left, right = (np.repeat(wheel, 10) * RADIUS for wheel in (run.left, run.right))
        v, w, h = (left + right) / 2, (right - left) / TRACK, PERIOD / 10
        yaw = 3.0 + np.cumsum(w * h) - w * h / 2
        across = -k * v * w * v ** (power - 1.0)
        moved = np.cumsum(h * across * np.array([-np.sin(yaw), np.cos(yaw)]), axis=1)
        rows, every = run_of.data.copy(), 10 * round(FRAME / PERIOD)
        rows[1:, :2] += moved[:, every - 1 :: every].T[: len(rows) - 1]
        data[name] = rows
    return problem.with_data(data)


@pytest.mark.parametrize(("k", "power"), [(0.05, 1.0), (0.2, 2.0)])
def test_slip_in_bends_is_named_with_its_size(tmp_path: Path, k: float, power: float) -> None:
    problem = slipping(tmp_path, k, power)
    few = [c for c in candidates(problem) if c.label == LAW]
    base, winner = found(problem, [*few, *delays(problem)])
    assert winner is not None and winner.labels == {LAW}
    place = winner.problem.index("base.across.side_slip.k")
    assert winner.estimate.low[place] < k < winner.estimate.high[place]
    assert 2.0 * winner.estimate.robust < 1.2 * winner.estimate.count < base.estimate.robust


@pytest.mark.parametrize("late", [0.0, 0.2])
def test_a_late_camera_slips_nowhere(tmp_path: Path, late: float) -> None:
    problem = written(tmp_path, late)
    few = [c for c in candidates(problem) if c.label == LAW]
    _, winner = found(problem, [*few, *delays(problem)])
    assert (winner is None) == (late == 0.0)
    assert winner is None or LAW not in winner.labels
