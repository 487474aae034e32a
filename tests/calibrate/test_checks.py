"""Each misleading data set gives a finding that names the column and the reason."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosim.calibrate import Problem
from cosim.calibrate.checks.examine import check_data, check_model
from cosim.calibrate.checks.finding import Finding
from cosim.calibrate.checks.swaps import check_channels
from cosim.data.signals import Table
from tests.problems import simulator


def findings(problem: Problem) -> list[Finding]:
    return check_data(problem) + check_model(simulator(problem))


def changed(problem: Problem, column: str, function) -> Problem:
    index = [c.name for c in problem.channels].index(column)
    data = {}
    for run in problem.runs:
        values = run.data.copy()
        values[:, index] = function(values[:, index])
        data[run.name] = values
    return problem.with_data(data)


def freeze(values: np.ndarray) -> np.ndarray:
    result = values.copy()
    result[900:] = result[900]
    return result


def late(values: np.ndarray) -> np.ndarray:
    return np.concatenate([np.full(40, values[0]), values[:-40]])


def test_good_data_give_none(noisy, measured) -> None:
    assert findings(noisy(0)) == []
    assert findings(measured) == []


@pytest.mark.parametrize(
    ("column", "function", "kind", "reason"),
    [
        ("speed", lambda x: x * 30 / np.pi, "unit", "rpm"),
        ("voltage", lambda x: x * 1e3, "unit", "thousandths"),
        ("angle", lambda x: np.degrees(x), "unit", "degrees"),
        ("current", lambda x: -x, "sign", "sign turned round"),
        ("voltage", freeze, "frozen", "frozen"),
        ("current", lambda x: np.full_like(x, 1.5), "constant", "constant"),
        ("angle", lambda x: np.full_like(x, np.nan), "empty", "no values"),
    ],
)
def test_one_column(noisy, column, function, kind, reason) -> None:
    found = findings(changed(noisy(0), column, function))
    mine = [f for f in found if f.column == column and f.kind == kind]
    assert mine, [str(f) for f in found]
    assert any(reason in f.text for f in mine), [str(f) for f in mine]


@pytest.mark.parametrize(
    ("factor", "severity"), [(3.0, "warning"), (np.pi / 30, "error"), (20.0, "error")]
)
def test_a_factor_that_no_unit_explains_may_be_what_the_model_lacks(
    noisy, factor: float, severity: str
) -> None:
    """Cold grease triples a current; neither rpm nor a factor of twenty is physics."""
    found = findings(changed(noisy(0), "current", lambda x: factor * x))
    assert [f.severity for f in found if (f.column, f.kind) == ("current", "unit")] == [severity]


def test_late_column(noisy) -> None:
    found = [f for f in findings(changed(noisy(0), "speed", late)) if f.kind == "clock"]
    assert [f.column for f in found] == ["speed"]
    seconds = float(found[0].text.partition("late by ")[2].split()[0])
    # shifted by 40 ms; the nominal parameters make the speed up to some ms early or late
    assert abs(seconds - 0.04) < 0.01


def test_swapped_columns(noisy) -> None:
    problem = noisy(0)
    # two columns of one unit: the bench has them only if the voltage counts as a current
    channels = [replace(c, unit="A") if c.name == "voltage" else c for c in problem.channels]
    order = [0, 2, 1, 3]
    data = {run.name: run.data[:, order] for run in problem.runs}
    found = findings(problem.changed(channels=channels).with_data(data))
    columns = {"current", "voltage"}
    assert any(
        f.kind in ("swapped", "unit") and set(f.column.split(" and ")) & columns for f in found
    )


@pytest.mark.parametrize("crossed", [True, False])
def test_two_sides_that_carry_one_load(crossed: bool) -> None:
    """What is common to both sides, and wrong in the model, hides an exchange from the misfit."""
    times = np.linspace(0.0, 10.0, 500)
    common, apart = 3.0 * np.sin(times), 0.5 * np.sin(3.0 * times)
    left, right = common + apart, common - apart
    data = np.column_stack([right, left] if crossed else [left, right])
    run: Any = SimpleNamespace(name="A", data=data)
    channels = [
        SimpleNamespace(name=n, unit="A", sigma=0.05, signal=f"{n}.i") for n in ("left", "right")
    ]
    problem: Any = SimpleNamespace(runs=[run], channels=channels)
    model = 0.5 * np.column_stack([left, right])
    found = list(check_channels(problem, {"A": model}, set()))
    assert [f.column for f in found] == (["left and right"] if crossed else [])
    assert not crossed or "look swapped" in found[0].text


def test_short_run_and_clock_that_goes_back(noisy) -> None:
    problem = noisy(0)
    first, second, third = problem.runs
    times = second.times.copy()
    times[500] = times[498]
    runs = [
        replace(first, times=first.times[:30], data=first.data[:30]),
        replace(second, times=times),
        third,
    ]
    found = check_data(problem.changed(runs=runs))
    assert {(f.kind, f.run) for f in found} >= {("short", "sines"), ("clock", "stairs")}
    assert all(f.column == "time" for f in found)


def test_a_column_coarser_than_its_noise_may_rest(noisy) -> None:
    """Rounding hides the noise of a machine at rest: no reason to call its sensor frozen."""
    quantum = 1.0  # V, against a noise of some 0.1 V

    def rest(values: np.ndarray) -> np.ndarray:
        result = quantum * np.round(values / quantum)
        result[900:] = result[900]
        return result

    found = findings(changed(noisy(0), "voltage", rest))
    mine = [f for f in found if f.column == "voltage" and f.kind == "frozen"]
    assert mine
    assert all(f.severity == "warning" and "resolution of 1" in f.text for f in mine)


def test_a_machine_comes_back_to_rest(noisy) -> None:
    """Noise that is absent at rest, twice at the same value: no frozen sensor."""

    def rest(values: np.ndarray) -> np.ndarray:
        result = values.copy()
        result[:200] = result[900:] = 0.0
        return result

    found = findings(changed(noisy(0), "speed", rest))
    mine = [f for f in found if f.column == "speed" and f.kind == "frozen"]
    assert mine
    assert all(f.severity == "warning" and "as it does elsewhere" in f.text for f in mine)


def test_all_problems_are_listed_at_once(noisy) -> None:
    problem = changed(changed(noisy(0), "voltage", freeze), "current", lambda x: -x)
    runs = [
        replace(run, inputs={"motor.w_ref": Table(run.times, 0 * run.times, text="log:speed_set")})
        if run.name == "check" else run
        for run in problem.runs
    ]  # fmt: skip
    found = findings(problem.changed(runs=runs))
    assert {"frozen", "sign", "constant"} <= {f.kind for f in found}
    assert any(f.column == "speed_set" and f.run == "check" for f in found)
