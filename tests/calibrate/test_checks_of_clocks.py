"""Clocks, steps and periods of a data set that contradict each other."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate import Problem, read_problem
from cosim.calibrate.calibration import calibrated
from cosim.calibrate.checks.finding import NO_SOURCE, Finding
from cosim.calibrate.checks.late import check_late
from cosim.calibrate.checks.scale import check_scale
from cosim.calibrate.checks.times import check_times
from tests.diagnose import disc
from tests.problems import simulator


def of_kind(problem: Problem, kind: str) -> list[Finding]:
    return [f for f in check_times(problem) if f.kind == kind]


@pytest.mark.parametrize(
    ("step", "search", "named", "way"),
    [
        (3e-4, 1e-3, "6.667", "step = 0.00025,"),
        (5e-4, 3e-4, "6.667", "search_step = 0.00025,"),
        (5e-4, 1e-3, "", ""),
        # rounded to the digits of a mapping; samples meet recorded points to a thousandth
        (2.857143e-4, 1e-3, "", ""),
    ],
)
def test_a_step_must_divide_the_period(
    noisy, step: float, search: float, named: str, way: str
) -> None:
    problem = noisy(0)
    problem = problem.changed(
        step=step, search=replace(problem.search, step=search), period=2e-3, source=NO_SOURCE
    )
    found = of_kind(problem, "step")
    assert [f.severity for f in found] == (["error"] if named else [])
    assert all(f"({named})" in f.text and way in f.text for f in found)


@pytest.mark.parametrize(("off", "named"), [(0.2, True), (0.1, False), (0.0, False)])
def test_stamps_that_are_off_by_a_fifth_of_the_interval_jitter(
    noisy, off: float, named: bool
) -> None:
    """Even within the share that is off: 0.163 and 0.082 of it, to 0.003 of 2000 intervals."""
    problem, random = noisy(0), np.random.default_rng(7)
    runs = [
        replace(run, times=run.times + off * 1e-3 * random.uniform(-1.0, 1.0, run.times.size))
        for run in problem.runs
    ]
    found = of_kind(problem.changed(runs=runs, source=NO_SOURCE), "jitter")
    assert [f.run for f in found] == ([run.name for run in runs] if named else [])


@pytest.mark.parametrize("off", [0.0, 0.2])
def test_lost_rows_are_no_jitter_of_what_is_even(noisy, off: float) -> None:
    """Of 2000 rows each 20th is lost: the intervals deviate by 0.22 of the usual one."""
    problem, random = noisy(0), np.random.default_rng(8)
    runs = []
    for run in problem.runs:
        kept = np.arange(run.times.size) % 20 != 10
        times = run.times + off * 1e-3 * random.uniform(-1.0, 1.0, run.times.size)
        runs.append(replace(run, times=times[kept], data=run.data[kept]))
    problem = problem.changed(runs=runs, source=NO_SOURCE)
    assert bool(of_kind(problem, "jitter")) == (off > 0.0)
    assert bool(of_kind(problem, "gap")) == (off == 0.0)


@pytest.mark.parametrize(
    ("factor", "period", "severity", "said"),
    [
        (1e3, 1e-3, "error", "samples are 1 s apart, but period = 0.001 s, 1000 times less"),
        (1e3, 2e-3, "", ""),  # no other unit makes that of it
        (1.0, 1e-3, "", ""),
        (1e3, None, "warning", "1000 communication steps"),
    ],
)
def test_a_clock_in_thousandths_contradicts_the_period(
    noisy, factor: float, period: float | None, severity: str, said: str
) -> None:
    problem = noisy(0)
    runs = [replace(run, times=run.times * factor) for run in problem.runs]
    step = 1e-3 if period is None else 2.5e-4
    problem = problem.changed(runs=runs, period=period, step=step, source=NO_SOURCE)
    found = of_kind(problem, "rate")
    assert [f.severity for f in found] == ([severity] if severity else [])
    assert all(said in f.text and 'write the unit into its head ("time [ms]")' in f.text
               for f in found)  # fmt: skip


def test_a_clock_that_is_estimated_wants_points_close_together(noisy) -> None:
    problem = noisy(0)
    late = replace(
        problem.parameters[0], name="late", targets=(("clock:speed", 1.0),), role="nuisance"
    )
    runs = [replace(run, times=run.times * 1e3) for run in problem.runs]
    problem = problem.changed(runs=runs, period=1e-3, step=2.5e-4, source=NO_SOURCE)
    assert of_kind(problem, "rate")
    assert not of_kind(problem.with_parameters([*problem.parameters, late]), "rate")


@pytest.mark.parametrize("factor", [4e3, 1.0])
def test_a_scale_that_is_wrong_names_the_clock_where_samples_are_far_apart(
    noisy, factor: float
) -> None:
    """Four steps to a sample: the interval over the step is no power of a thousand."""
    problem = noisy(0)
    models = {run.name: run.data for run in problem.runs}
    index = [c.name for c in problem.channels].index("speed")
    data = {run.name: run.data.copy() for run in problem.runs}
    for values in data.values():
        values[:, index] *= 1e-3
    problem = problem.with_data(data).changed(step=problem.runs[0].interval / factor)
    [found] = check_scale(problem, models, index)
    assert ("4000 communication steps apart: if the clock counts" in found.text) == (factor > 1e3)


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.0, 0.02])
def test_inputs_that_are_late_beside_something_else_are_a_warning(
    tmp_path: Path, friction: float
) -> None:
    """What else is wrong draws the shift, so that no figure can be given for sure."""
    late = 6
    folder = disc.write(
        tmp_path, lambda w, theta, t: friction * np.tanh(w / 0.02), names=("sweep", "check")
    )
    for file in folder.glob("*.csv"):
        rows = np.loadtxt(file, delimiter=",", skiprows=1)
        rows[:, 1] = np.concatenate([np.zeros(late), rows[:-late, 1]])
        np.savetxt(file, rows, delimiter=",", fmt="%.7g", header="time,tau,w,theta", comments="")
    estimate, _ = calibrated(simulator(read_problem(folder)))
    (found,) = check_late(estimate)
    assert (found.severity, found.kind) == ("warning" if friction else "error", "clock")
    assert "after what it causes" in found.text
    assert ("once it is known what else is wrong" in found.text) == bool(friction)
