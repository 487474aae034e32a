"""Runs of a base with two wheels that was placed by hand, and what only looks like that."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from cosim.calibrate import read_problem
from cosim.calibrate.calibration import calibrated
from cosim.calibrate.checks.each_run import check_each_run
from cosim.calibrate.checks.examine import examine
from cosim.calibrate.checks.finding import Finding
from cosim.calibrate.checks.own_errors import exact_starts
from cosim.calibrate.estimate import Estimate
from tests.placed import RADIUS, TRACK, Wrong, write
from tests.problems import simulator

HEADING = """
[[nuisance]]
name = "heading"
unit = "rad"
nominal = 0.0
span = 0.06
per_run = true
targets = "base.pose_phi"
"""


def estimated(folder: Path, runs: Sequence[Wrong], more: str = "") -> Estimate:
    """The measures of the base from these runs."""
    return calibrated(simulator(read_problem(write(folder, runs, more))))[0]


def found(folder: Path, runs: Sequence[Wrong], more: str = "") -> list[Finding]:
    return list(check_each_run(estimated(folder, runs, more)))


PLACED = [Wrong((0.0, 0.0, angle)) for angle in (0.012, -0.008, 0.004)]


def test_headings_placed_by_hand_are_said_with_the_way_out(tmp_path: Path) -> None:
    """Three sigma and less of the noise of one sample: no first sample shows it."""
    [finding] = found(tmp_path, PLACED)
    assert (finding.severity, finding.kind) == ("error", "start")
    assert "base.pose_phi 0.01" in finding.text
    assert "instead of 0 in r0, and less so in 2 more" in finding.text
    assert 'a [[nuisance]] with targets = "base.pose_phi", nominal = 0' in finding.text
    assert "pose_x" not in finding.text


SAID = '[starts]\nheading = "base.pose_phi"\n'


def test_runs_that_say_another_heading_each_keep_it_as_the_nominal_one(tmp_path: Path) -> None:
    """One number for all runs would begin most of them the wrong way round."""
    runs = [
        Wrong((0.0, 0.0, angle + off), said=angle)
        for angle, off in ((0.0, 0.012), (1.5, -0.008), (-1.5, 0.004))
    ]
    [finding] = found(tmp_path, runs, SAID)
    assert 'targets = "base.pose_phi", nominal = "heading", span = 0.05' in finding.text
    entry = HEADING.replace("nominal = 0.0", 'nominal = "heading"')
    estimate = estimated(tmp_path, runs, SAID + entry)
    for k, wrong in enumerate(runs):
        value = estimate.values[f"heading@r{k}"]
        # three deviations, as below
        deviation = estimate.deviation[estimate.problem.index(f"heading@r{k}")]
        assert abs(value - wrong.pose[2]) < 3.0 * deviation


def test_the_way_out_gives_intervals_with_the_truth(tmp_path: Path) -> None:
    """And nothing more to say."""
    estimate = estimated(tmp_path, PLACED, HEADING)
    assert list(check_each_run(estimate)) == []
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
        [Wrong(drift=0.003)] * 3,
        [Wrong(zero=0.02)] * 3,
        [Wrong(larger=0.01)] * 3,
        [Wrong(late=5)] * 3,
        [Wrong(gain=1.1)] * 3,
    ],
    ids=[
        "clean",
        "a gyro that drifts",
        "the zero of the heading alone",
        "unequal wheels",
        "a late column",
        "a column with a gain",
    ],
)
def test_what_is_the_same_in_all_runs_is_an_effect(tmp_path: Path, runs: list[Wrong]) -> None:
    assert found(tmp_path, runs) == []


@pytest.mark.parametrize(
    ("wrong", "what", "size", "target"),
    [
        (Wrong(late=5), "how late y is", 0.1, "clock:y"),
        (Wrong(late=13), "how late y is", 0.26, "clock:y"),
        (Wrong(gain=-1.0), "the error of the gain of y", -2.0, "column:gain:y"),
        (Wrong(gain=1.05), "the error of the gain of y", 0.05, "column:gain:y"),
        (Wrong(zero=0.05), "the zero of yaw", 0.05, "column:bias:yaw"),
        (Wrong(drift=0.02), "the drift of the zero of yaw", 0.02, "column:zero_drift:yaw"),
    ],
)
@pytest.mark.parametrize("unused", [0, 1], ids=["fitted", "unused"])
def test_a_column_that_is_another_one_in_one_run(
    tmp_path: Path, wrong: Wrong, what: str, size: float, target: str, unused: int
) -> None:
    folder = write(tmp_path, [Wrong(), Wrong(), wrong], unused=unused)
    estimate = calibrated(simulator(read_problem(folder)))[0]
    [finding] = check_each_run(estimate)
    assert (finding.severity, finding.kind) == ("error", "differs")
    said = f"a column is another one from run to run: {what} "
    assert finding.text.startswith(said)
    # what the fits of single seconds leave of it
    assert float(finding.text.removeprefix(said).split()[0]) == pytest.approx(size, rel=0.03)
    assert "instead of 0 in r2 alone. With that" in finding.text
    assert f'Mend the log, or estimate it: a [[nuisance]] with targets = "{target}"' in finding.text


def test_a_drift_that_is_another_one_in_each_run(tmp_path: Path) -> None:
    [finding] = found(tmp_path, [Wrong(drift=rate) for rate in (0.004, -0.003, 0.002)])
    assert "the drift of the zero of yaw 0.003" in finding.text
    assert "in r0, and less so in 2 more" in finding.text


def test_a_wheel_that_is_larger_in_one_run_is_no_column(tmp_path: Path) -> None:
    assert found(tmp_path, [Wrong(), Wrong(), Wrong(larger=0.02)]) == []


@pytest.mark.parametrize(
    "wrong", [Wrong(late=5), Wrong(gain=1.1), Wrong((0.004, 0.0, 0.0))], ids=str
)
def test_one_run_says_nothing_of_what_differs(tmp_path: Path, wrong: Wrong) -> None:
    """A gain, a late column, a zero: effects, as long as no other run lacks them."""
    assert [f for f in found(tmp_path, [wrong]) if f.severity == "error"] == []


def test_what_is_taken_as_exact_is_listed(tmp_path: Path) -> None:
    """Of a machine that drives about, and where it matters where it begins."""
    problem = read_problem(write(tmp_path, [Wrong()]))
    assert "(base.pose_x, base.pose_y, base.pose_phi)" in exact_starts(problem)
    assert exact_starts(problem.changed(relative=[("x", "y", "yaw")])) == ""
    free = read_problem(write(tmp_path, [Wrong()], HEADING))
    assert "(base.pose_x, base.pose_y)" in exact_starts(free)


def test_a_start_that_is_said_in_another_turn_is_told_as_that(tmp_path: Path) -> None:
    """The twin is said in the turn in which the column begins."""
    runs = [Wrong((0.0, 0.0, 0.0)), Wrong((0.0, 0.0, 3.14), said=-3.143)]
    told = examine(simulator(read_problem(write(tmp_path, runs, SAID))))
    [finding] = [f for f in told if f.kind == "start"]
    assert finding.run == "r1" and "begins a whole turn from where it is said to (yaw 3.1" in (
        finding.text
    )
    runs[1] = runs[1]._replace(said=3.14)
    assert not any(
        f.kind == "start" for f in examine(simulator(read_problem(write(tmp_path, runs, SAID))))
    )
