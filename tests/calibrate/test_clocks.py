"""Clocks of channels that are estimated, and inputs that change on a clock of their own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate import Problem, read_problem
from cosim.calibrate.clocks import clocked, offsets
from cosim.calibrate.fit import fit
from cosim.calibrate.simulator import Simulator
from cosim.errors import UnitError, UnknownNameError, ValueRangeError
from cosim.intake.example import FRAME, RADIUS, drive, write_csv
from tests.robot_logs import CLOCK, ROBOT, START, write_system

LATE = 0.11
MAPPING = f"""
relative = [["x", "y", "yaw"]]{ROBOT}[[parameter]]
name = "r"
unit = "m"
nominal = {RADIUS}
min = 0.01
max = 0.1
targets = "base.r"
[[run]]
name = "one"
files = {{ cmd = "one_cmd.csv", pose = "one_pose.csv" }}
purpose = "identification"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("clocks")
    write_csv(drive(7, late=LATE), "one", made)
    write_system(made)
    return made


def problem(folder: Path, clock: str = CLOCK) -> Problem:
    path = folder / "dataset.toml"
    path.write_text(MAPPING + clock)
    return read_problem(folder)


def misfit(it: Problem, late: float) -> float:
    theta = it.nominal
    theta[it.index("clock")] = late
    apart = (it.runs[0].data - Simulator(it).simulate(theta, "one")) / it.sigma
    return float(np.nanmean(apart**2))


def test_a_late_clock_shifts_what_the_channels_read(folder: Path) -> None:
    it = problem(folder)
    assert clocked(it.parameters) == {"x", "y", "yaw"}
    assert misfit(it, LATE) < 0.2 * misfit(it, 0.0)
    assert misfit(it, LATE) < 0.2 * misfit(it, 2 * LATE)


def test_a_late_clock_is_estimated(folder: Path) -> None:
    """The true clock, with a start pose that is estimated: what is left is the noise."""
    path = folder / "dataset.toml"
    path.write_text(MAPPING.replace("relative", "#") + CLOCK + START)
    estimate = fit(Simulator(read_problem(folder)))
    (clock,) = offsets(estimate).values()
    assert abs(clock["value"] - LATE) < clock["ci95"][1] - clock["ci95"][0]  # four deviations
    ((_, residual),) = estimate.residuals
    # 3 x 280 samples: the deviation of the mean square is 0.05, rounding adds 0.001
    assert np.nanmean(residual**2) == pytest.approx(1.0, abs=0.2)


def test_values_that_a_clock_may_move_out_of_the_run_do_not_count(folder: Path) -> None:
    run = problem(folder).runs[0]
    out = (run.times < 0.5) | (run.times > run.times[-1] - 0.5)
    assert np.array_equal(np.isnan(run.data).all(axis=1), out)
    assert np.isfinite(problem(folder, "").runs[0].data).all()


def test_values_that_a_drift_may_move_out_of_the_run_do_not_count(folder: Path) -> None:
    drift = CLOCK.replace("clock:", "clock:drift:").replace('unit = "s"', 'unit = "1"')
    run = problem(folder, drift.replace("-0.5", "-0.1").replace("0.5", "0.02")).runs[0]
    end = run.times[-1]
    out = run.times + 0.1 * (run.times - run.times[0]) > end
    assert np.array_equal(np.isnan(run.data).all(axis=1), out) and out.any()


def test_a_held_clock_stays(folder: Path) -> None:
    it = problem(folder)
    theta = it.nominal
    theta[it.index("clock")] = LATE
    held = it.hold({"clock": LATE})
    assert held.names == ("r",)
    one, other = Simulator(it).simulate(theta, "one"), Simulator(held).simulate(held.nominal, "one")
    assert np.array_equal(one, other)


def test_clocks_have_units_and_names(folder: Path) -> None:
    it = problem(folder, CLOCK.replace('unit = "s"', 'unit = "ms"').replace("0.5", "500.0"))
    theta = it.nominal
    theta[it.index("clock")] = 20.0
    # 20 * 0.001 rounds
    assert it.log_errors(theta, "one") == pytest.approx(dict.fromkeys(("x", "y", "yaw"), 0.02))
    with pytest.raises(
        UnknownNameError,
        match=r"no channel 'yow' that is measured, and no input .*; did you mean 'yaw'",
    ):
        problem(folder, CLOCK.replace("clock:yaw", "clock:yow"))
    with pytest.raises(
        UnknownNameError,
        match=r"two clocks that drift apart, state that of the channels; there is x, y, yaw",
    ):
        problem(folder, CLOCK.replace("clock:yaw", "clock:drift:base.w_l"))
    with pytest.raises(UnitError, match=r"nuisance clock: clock:drift:x"):
        problem(folder, CLOCK.replace("clock:x", "clock:drift:x"))
    with pytest.raises(UnitError, match=r"nuisance clock: clock:x"):
        problem(folder, CLOCK.replace('unit = "s"', 'unit = "m"'))
    with pytest.raises(ValueRangeError, match="parameter clock"):
        problem(folder, CLOCK.replace("nominal = 0.0", "nominal = 0.7"))


def test_clocks_of_single_runs(folder: Path) -> None:
    it = problem(folder, CLOCK.replace('name = "clock"', 'name = "clock"\nper_run = true'))
    assert it.names == ("r", "clock@one")


def test_held_inputs_change_at_their_own_times(folder: Path) -> None:
    """Commands come between the samples of the camera, on whose clock the run is."""
    run = problem(folder, "").runs[0]
    assert np.diff(run.times) == pytest.approx(FRAME, abs=1e-9)
    signal = run.inputs["base.w_l"]
    truth = drive(7, late=LATE)
    asked = truth.commanded + 0.001  # just after each command
    known = asked[(asked > LATE) & (asked < truth.stamped[-1])]
    wanted = truth.left[(asked > LATE) & (asked < truth.stamped[-1])]
    # twelve digits in the file
    assert signal.at(known - LATE) == pytest.approx(wanted, rel=1e-9)
    # on a grid they are what they are at its points
    path = folder / "dataset.toml"
    path.write_text(MAPPING.replace("period = 0.01", f"resample = {FRAME}"))
    coarse = read_problem(folder).runs[0].inputs["base.w_l"]
    assert np.max(np.abs(coarse.at(known - LATE) - wanted)) > 1.0


def test_of_a_burst_of_commands_the_last_one_counts(tmp_path: Path, folder: Path) -> None:
    for name in ("robot.toml", "one_pose.csv"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    head, *rows = (folder / "one_cmd.csv").read_text().splitlines()
    stamp = int(rows[100].partition(",")[0])
    rows.insert(101, f"{stamp + 1000},1.0,2.0")  # a microsecond later
    (tmp_path / "one_cmd.csv").write_text("\n".join([head, *rows]))
    signal = problem(tmp_path, "").runs[0].inputs["base.w_r"]
    at = np.array([100 * 0.02 - LATE + 0.005])
    assert signal.at(at) == pytest.approx(2.0 * np.pi / 30, rel=1e-9)  # digits of the file
