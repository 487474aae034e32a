"""The same model in every way in which a run is asked: fits, derivatives, replays, short runs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate.calibration import _Measure
from cosim.calibrate.differences import jacobian
from cosim.calibrate.fit import fit
from cosim.calibrate.input_noise import propagated
from cosim.calibrate.mapping import read_problem
from cosim.calibrate.nuisance import released
from cosim.calibrate.problem import Problem
from cosim.calibrate.replay import replay
from cosim.errors import ScenarioError
from tests.calibrate.test_input_noise import SIGMA, logged
from tests.diagnose import disc
from tests.problems import simulator

NAMES = ("sweep", "steps")
LATE = """
[[nuisance]]
name = "{name}"
unit = "{unit}"
nominal = {nominal}
min = -0.5
max = 0.5
targets = "{target}"
"""


def plain(folder: Path, more: str = "") -> Problem:
    """A disc that lacks nothing."""
    disc.write(folder, lambda w, theta, t: 0.0, seconds=1.6, names=NAMES)
    with (folder / "dataset.toml").open("a", encoding="utf-8") as file:
        file.write(more)
    return read_problem(folder)


@pytest.mark.parametrize("which", [[0.0, 0.0, 1.0], [1.0, 1.0, 0.0]])
def test_errors_of_the_model_move_parameters_as_a_refit_says(
    tmp_path: Path, which: list[float]
) -> None:
    """A ramp in the poses, where noise of the wheel speeds makes them walk."""
    white, _ = propagated(simulator(logged(tmp_path, 0, SIGMA, f"sigma = {SIGMA}"), 1))
    estimate = fit(white)
    (run,) = estimate.problem.runs
    ramp = np.outer(np.linspace(0.0, 1.0, run.times.size), which)
    (said,) = _Measure(estimate).moves({run.name: ramp})
    sigma = estimate.problem.sigma
    moved = fit(white.of(estimate.problem.with_data({run.name: run.data + ramp * sigma})))
    (found,) = np.abs(moved.theta - estimate.theta) / estimate.deviation
    # without its noise in the errors, 5 to 7 times as much
    assert said == pytest.approx(found, rel=0.25)


def test_a_replay_reads_clocks_and_columns_as_the_fit_does(tmp_path: Path) -> None:
    more = LATE.format(name="late", unit="s", nominal=0.1, target="clock:load.tau")
    more += LATE.format(name="turned", unit="rad", nominal=0.3, target="column:bias:theta")
    more += LATE.format(name="behind", unit="s", nominal=0.04, target="clock:theta")
    problem = plain(tmp_path, more)
    run = problem.run("sweep")
    model = simulator(problem).simulate(problem.nominal, run)
    recording, measured = replay(problem, problem.nominal, run)
    speed = np.interp(run.times, recording.time, recording["load.w"])
    known = np.isfinite(model[:, 0])
    assert np.allclose(speed[known], model[known, 0], atol=1e-9)
    (angle,) = (item for item in measured if item.signals == ("load.phi",))
    assert angle.times == pytest.approx(run.times - 0.04)
    assert angle.values[:, 0] == pytest.approx(run.data[:, 1] - 0.3, nan_ok=True)


def test_a_derivative_is_taken_over_a_step_that_the_bounds_hold(tmp_path: Path) -> None:
    problem = plain(tmp_path)
    first, second = problem.parameters
    narrow = problem.with_parameters(
        [replace(first, minimum=0.0249, maximum=0.0251, span=0.02), second]
    )
    theta = problem.nominal
    wanted, found = (
        jacobian(simulator(p), theta, ["sweep"], relative=r, central=False)[0].values[:, 1, 0]
        for p, r in ((problem, 1e-3), (narrow, 2e-2))
    )
    known = np.isfinite(wanted)
    # one-sided differences, of two steps of half a percent
    assert found[known] == pytest.approx(wanted[known], rel=0.02, abs=1e-3 * np.nanmax(wanted))


@pytest.mark.parametrize("samples", [9, 30])
def test_start_values_are_estimated_in_short_runs(tmp_path: Path, samples: int) -> None:
    more = LATE.format(name="phi", unit="rad", nominal=0.1, target="load.angle")
    disc.write(tmp_path, lambda w, theta, t: 0.0, seconds=1.6, names=NAMES)
    for name in NAMES:
        path = tmp_path / f"{name}.csv"
        path.write_text("".join(path.read_text().splitlines(keepends=True)[: 1 + samples]))
    with (tmp_path / "dataset.toml").open("a", encoding="utf-8") as file:
        file.write(more + "late = true\nper_run = true\n")
    problem = read_problem(tmp_path)
    found, _, fall = released(simulator(problem), problem.nominal)
    assert fall > 0.0
    for run in found.problem.runs:
        assert run.starts["load.angle"] == pytest.approx(0.0, abs=0.03)  # J is off


def test_a_run_without_a_value_decides_nothing(tmp_path: Path) -> None:
    """Wherever it stands among the others."""
    problem = plain(tmp_path)
    nothing = replace(
        problem.runs[0], name="nothing", data=np.full_like(problem.runs[0].data, np.nan)
    )
    first, last = (
        fit(simulator(problem.changed(runs=runs))).theta.tolist()
        for runs in ([nothing, *problem.runs], [*problem.runs, nothing])
    )
    assert first == last == pytest.approx([disc.J, disc.B], rel=0.1)


def test_a_mapping_without_parameters_is_refused(tmp_path: Path) -> None:
    problem = plain(tmp_path).with_parameters([])
    with pytest.raises(ScenarioError, match="no parameter is open, so there is nothing to fit"):
        fit(simulator(problem))
