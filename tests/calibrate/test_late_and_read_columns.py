"""Clocks that are held or estimated, and errors of columns, in logs as they come."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate.recorder import Reading
from tests.calibrate.test_log_habits import SIZE, SPEED, STEP, TIMES, TORQUE, read, written
from tests.problems import simulator

HELD = '[parameters]\n"clock:w" = 0.03'
ESTIMATED = """
[[nuisance]]
name = "late"
unit = "s"
nominal = 0.03
min = -0.03
max = 0.03
targets = "clock:w"
"""
ANGLE = np.degrees(np.cumsum(SPEED) * STEP)


@pytest.mark.parametrize("begin", [0.0, 5.0])
@pytest.mark.parametrize("clock", [HELD, ESTIMATED])
def test_what_a_clock_moves_out_of_a_run_does_not_count_whenever_the_log_begins(
    tmp_path: Path, begin: float, clock: str
) -> None:
    log = written("time [s],tau [N.m],w [rad/s]", ",", begin + TIMES, TORQUE, SPEED)
    problem = read(tmp_path, log, TOP=clock)
    run = problem.run("one")
    assert run.times[0] == begin
    seen = np.isfinite(run.data[:, 0])
    last = SIZE if clock == HELD else SIZE - 3
    assert np.flatnonzero(seen).tolist() == list(range(3, last))
    model = simulator(problem, 1).simulate(problem.nominal, run)
    assert np.isfinite(model[seen, 0]).all()


def turned(folder: Path, target: str, unit: str, size: float) -> tuple[np.ndarray, np.ndarray]:
    """The disc's angle in degrees, with an error of its column; what it reads, with and without."""
    top = f"""
[[parameter]]
name = "error"
unit = "{unit}"
nominal = {size}
min = -{size}
max = {size}
targets = "{target}"
[channels.phi]
signal = "load.phi"
unit = "deg"
sigma = 0.1
"""
    log = written("time,tau,w,phi", ",", TIMES, TORQUE, SPEED, ANGLE)
    problem = read(folder, log, TOP=top)
    place = [c.name for c in problem.channels].index("phi")
    theta = problem.nominal
    reading = simulator(problem, 1).simulate(theta, "one")[:, place]
    theta[problem.index("error")] = 0.0
    return reading, simulator(problem, 1).simulate(theta, "one")[:, place]


def test_a_bias_of_a_column_is_converted_to_what_its_channel_reads(tmp_path: Path) -> None:
    found, plain = turned(tmp_path, "column:bias:phi", "rad", 0.1)
    np.testing.assert_allclose(found - plain, np.degrees(0.1), rtol=1e-9)


def test_a_drift_of_a_column_grows_from_its_first_sample_on(tmp_path: Path) -> None:
    found, plain = turned(tmp_path, "column:zero_drift:phi", "rad/s", 0.01)
    wanted = np.degrees(0.01) * (TIMES - TIMES[0])
    np.testing.assert_allclose(found - plain, wanted, rtol=0, atol=1e-9)  # of tens of degrees


def test_a_wave_of_a_column_repeats_with_the_turn_whatever_its_unit(tmp_path: Path) -> None:
    found, plain = turned(tmp_path, "column:wave:phi", "rad", 0.02)
    wanted = np.degrees(0.02) * np.sin(np.radians(plain))
    np.testing.assert_allclose(found - plain, wanted, rtol=0, atol=1e-9)
    assert np.ptp(plain) > 45.0


def test_a_wave_is_sought_over_the_same_angles_whatever_their_unit(tmp_path: Path) -> None:
    found = []
    for unit, angle in (("deg", ANGLE), ("rad", np.radians(ANGLE))):
        top = f'[channels.phi]\nsignal = "load.phi"\nunit = "{unit}"\nsigma = 0.1'
        (tmp_path / unit).mkdir()
        log = written("time,tau,w,phi", ",", TIMES, TORQUE, SPEED, angle)
        problem = Reading("phi", "angle_ripple").added_to(read(tmp_path / unit, log, TOP=top), "")
        size, cycles, _ = problem.parameters[-3:]
        one = 1.0 if unit == "rad" else np.radians(1.0)
        found.append((one * size.maximum, one * size.span, cycles.span))
    assert found[0] == pytest.approx(found[1])
