"""Each misleading data set gives a finding that names the column and the reason."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from cosim.calibrate import Problem
from cosim.calibrate.checks.clipped import check_clipped
from cosim.calibrate.checks.examine import check_data, check_model, examine
from cosim.calibrate.checks.finding import NO_SOURCE, Finding, Source, lines
from cosim.calibrate.checks.late import check_late
from cosim.calibrate.checks.spiking import check_spikes
from cosim.calibrate.checks.swaps import check_channels
from cosim.calibrate.checks.times import check_times
from cosim.calibrate.fit import Effort, fit
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


def of_kind(problem: Problem, kind: str) -> list[Finding]:
    return [f for f in examine(simulator(problem)) if f.kind == kind]


def from_a_sheet(problem: Problem) -> Problem:
    """The noise is that of the sensors, and not a guess."""
    instruments = frozenset(channel.name for channel in problem.channels)
    return problem.changed(source=Source(instruments=instruments, rate=1000.0))


def in_all(problem: Problem, function) -> Problem:
    """A change of all columns of all runs."""
    columns = np.apply_along_axis
    return problem.with_data({r.name: columns(function, 0, r.data) for r in problem.runs})


@pytest.mark.parametrize("seed", range(5))
def test_good_data_of_any_seed_give_none(noisy, seed: int) -> None:
    """The tests' own chances are below 1e-5 for all of these samples (2e4 of four channels)."""
    assert examine(simulator(from_a_sheet(noisy(seed)))) == []


def lowpass(x: np.ndarray) -> np.ndarray:
    return sosfiltfilt(butter(2, 100.0, fs=1e3, output="sos"), x)


def mean_of_three(x: np.ndarray) -> np.ndarray:
    return np.convolve(np.pad(x, 1, "edge"), np.ones(3) / 3.0, "valid")


def interpolated(x: np.ndarray) -> np.ndarray:
    places = np.arange(x.size)
    return np.interp(places, places[::4], x[::4])


@pytest.mark.parametrize("function", [lowpass, mean_of_three, interpolated])
def test_columns_without_their_noise(noisy, function) -> None:
    problem = noisy(0)
    smooth = in_all(problem, function)
    found = of_kind(from_a_sheet(smooth), "smoothed")
    assert {f.column for f in found} == {c.name for c in problem.channels}
    assert all(f.severity == "error" and "near half the sample rate" in f.text for f in found)
    one = changed(noisy(0), "current", function)
    assert [f.column for f in of_kind(from_a_sheet(one), "smoothed")] == ["current"]


def test_a_noise_that_was_guessed_too_large_is_no_fault(noisy) -> None:
    problem = noisy(0).changed(source=NO_SOURCE)
    channels = [replace(c, sigma=5.0 * c.sigma) for c in problem.channels]
    assert not of_kind(problem.changed(channels=channels), "smoothed")
    channels = [replace(c, sigma=0.2 * c.sigma) for c in problem.channels]
    found = of_kind(problem.changed(channels=channels), "noise")
    assert len(found) == len(channels) and {f.severity for f in found} == {"warning"}


def test_columns_whose_values_stand_for_several_samples(noisy) -> None:
    found = of_kind(changed(noisy(0), "voltage", lambda x: np.repeat(x[::4], 4)[: x.size]), "held")
    assert {f.column for f in found} == {"voltage"}
    assert "changes every 4 samples only" in found[0].text and "fresh = true" in found[0].text


def struck(x: np.ndarray) -> np.ndarray:
    result = x.copy()
    result[[300, 700, 1500]] += [9.0, -7.0, 1e9]
    return result


def test_spikes_of_one_column_are_faults_of_the_log(noisy) -> None:
    found = of_kind(changed(noisy(0), "current", struck), "spikes")
    assert [f.run for f in found] == ["sines", "stairs", "check"]
    assert "has 3 single samples that stand out, the first at 0.3 s" in found[0].text
    assert "the largest 1e+09 A at 1.5 s" in found[0].text


def test_a_fault_is_told_at_the_time_of_the_log_where_the_model_begins_before_it(noisy) -> None:
    problem = changed(noisy(0), "current", struck)
    models = {run.name: other.data for run, other in zip(problem.runs, noisy(1).runs, strict=True)}
    runs = [replace(run, times=run.times + 2.0, lead=2.0) for run in problem.runs]
    found = list(check_spikes(problem.changed(runs=runs), models))
    assert "the first at 0.3 s, the largest 1e+09 A at 1.5 s" in found[0].text


def test_a_spike_that_hardly_adds_to_the_noise_stops_nothing(noisy) -> None:
    """The impact of a play may hide in all columns but one."""

    def impact(size: float) -> Callable[[np.ndarray], np.ndarray]:
        def moved(x: np.ndarray) -> np.ndarray:
            result = x.copy()
            result[700] += size
            return result

        return moved

    problem = noisy(0)
    sigma = next(c.sigma for c in problem.channels if c.name == "current")
    # 12 and 60 deviations on some 2000 samples: 0.07 and 1.8 of the noise's mean square
    for size, severity in ((12.0 * sigma, "warning"), (60.0 * sigma, "error")):
        found = of_kind(changed(problem, "current", impact(size)), "spikes")
        assert {f.severity for f in found} == {severity}


def test_a_jolt_moves_something(noisy) -> None:
    """The end of a play is felt for a sample by the current, and the speed is another one then."""
    jolted = changed(noisy(0), "current", struck)

    def pushed(x: np.ndarray) -> np.ndarray:
        at = np.arange(x.size)
        return x + sum(2.0 * np.where(at >= k, np.exp(-(at - k) / 50.0), 0.0)
                       for k in (300, 700, 1500))  # fmt: skip

    assert not of_kind(changed(jolted, "speed", pushed), "spikes")


def test_a_vibration_near_half_the_sampling_rate_is_no_spike(noisy) -> None:
    """A ripple of the torque at high speed is one: it beats, and stands out where it beats most."""
    problem = noisy(0)

    def shaken(x: np.ndarray) -> np.ndarray:
        at = np.arange(x.size)
        return x + np.where((at > 400) & (at < 800), 5.0 * np.cos(2.0 * np.pi * 0.525 * at), 0.0)

    assert not of_kind(changed(problem, "current", shaken), "spikes")
    found = of_kind(changed(changed(problem, "current", shaken), "current", struck), "spikes")
    assert "the largest 1e+09 A at 1.5 s" in found[0].text


def test_a_row_that_is_wrong_in_all_columns(noisy) -> None:
    struck_twice = changed(changed(noisy(0), "current", struck), "speed", struck)
    found = of_kind(struck_twice, "spikes")
    assert {f.column for f in found} == {"current", "speed"}
    assert {f.severity for f in found} == {"error"}


@pytest.mark.parametrize("apart", [0, 37])
def test_runs_that_are_copies(noisy, apart: int) -> None:
    problem = noisy(0)
    first = problem.run("sines").data
    copy = np.vstack([first[apart:], first[:apart]])
    found = of_kind(problem.with_data({"check": copy}), "copy")
    assert [(f.run, f.severity) for f in found] == [("check", "error")]
    assert "copy of run sines" in found[0].text and "confirms anything" in found[0].text
    assert (f"{apart} samples apart" in found[0].text) == bool(apart)


def test_the_same_motion_measured_twice_is_no_copy(noisy, exact) -> None:
    problem, random = noisy(0), np.random.default_rng(9)
    again = exact["sines"] + random.normal(size=exact["sines"].shape) * problem.sigma
    assert not of_kind(problem.with_data({"check": again}), "copy")


def test_an_angle_that_begins_anew(noisy) -> None:
    found = of_kind(changed(noisy(0), "angle", lambda x: np.mod(x, 2 * np.pi)), "wrapped")
    assert found and {f.column for f in found} == {"angle"} and "unwrap = true" in found[0].text


def test_a_current_without_a_unit_is_no_angle(noisy) -> None:
    """It may jump by 6.3 A, for the voltage that drives it does."""
    problem = changed(noisy(0), "current", lambda x: np.mod(x, 2 * np.pi))
    plain = [replace(c, unit="") for c in problem.channels]
    assert not of_kind(problem.changed(channels=plain), "wrapped")
    angle = changed(noisy(0), "angle", lambda x: np.mod(x, 2 * np.pi))
    plain = [replace(c, unit="") for c in angle.channels]
    assert {f.column for f in of_kind(angle.changed(channels=plain), "wrapped")} == {"angle"}


def test_a_clock_at_another_rate(noisy) -> None:
    problem = noisy(0).changed(source=Source(rate=1010.0))
    found = of_kind(problem, "rate")
    assert len(found) == 3
    assert "runs at 1000 samples per second, but set.toml says 1010" in found[0].text
    assert "the clock is 1.00% fast" in found[0].text
    problem = problem.changed(source=Source(rate=1010.0, allow=frozenset({"rate"})))
    assert {f.severity for f in of_kind(problem, "rate")} == {"warning"}


def test_clocks_in_thousandths(noisy) -> None:
    problem = noisy(0).changed(source=NO_SOURCE)
    slow = [replace(r, times=r.times * (1e3 if r.name == "check" else 1.0)) for r in problem.runs]
    [found] = [f for f in check_times(problem.changed(runs=slow)) if f.kind == "rate"]
    assert (found.severity, found.run, found.column) == ("error", "check", "time")
    assert "has samples every 1 s, those of sines are 0.001 s apart" in found.text
    slow = [replace(run, times=run.times * 1e3) for run in problem.runs]
    problem = problem.changed(step=1e-3)
    [found] = [f for f in check_times(problem.changed(runs=slow)) if f.kind == "rate"]
    assert found.severity == "warning" and "1000 communication steps" in found.text
    slow = [replace(r, times=r.times * (20.0 if r.name == "check" else 1.0)) for r in problem.runs]
    assert not [f for f in check_times(problem.changed(runs=slow)) if f.kind == "rate"]


@pytest.mark.parametrize(("interval", "warned"), [(10.0, True), (7.7, False)])
def test_clocks_of_whole_numbers_hardly_count_seconds(noisy, interval, warned) -> None:
    problem = noisy(0).changed(source=NO_SOURCE, step=2.5e-3)
    runs = [replace(r, times=interval * np.arange(r.times.size)) for r in problem.runs]
    found = [f for f in check_times(problem.changed(runs=runs)) if f.kind == "rate"]
    assert [f.severity for f in found] == ["warning"] * warned
    assert all("4000 communication steps" in f.text and '"time [ms]"' in f.text for f in found)


def test_where_all_columns_are_too_small_the_inputs_are_named(noisy) -> None:
    problem = noisy(0)
    data = {run.name: 0.01 * run.data for run in problem.runs}
    found = of_kind(problem.with_data(data), "unit")
    assert found and all("look at the units of the inputs and of the clock" in f.text
                         for f in found)  # fmt: skip
    one = of_kind(changed(problem, "voltage", lambda x: 0.01 * x), "unit")
    assert len(one) == 1 and "units of the inputs" not in one[0].text


def test_a_sign_turned_in_one_run_is_named_only_where_the_model_foretells_the_others(noisy) -> None:
    problem = noisy(0)
    data = {run.name: run.data.copy() for run in problem.runs}
    index = [c.name for c in problem.channels].index("current")
    data["stairs"][:, index] *= -1.0
    found = of_kind(problem.with_data(data), "sign")
    assert [(f.run, f.column) for f in found] == [("stairs", "current")]
    # where the model is wrong in the others, it cannot say which way round this one is
    random = np.random.default_rng(3)
    for name in ("sines", "check"):
        data[name][:, index] = np.cumsum(random.normal(size=data[name].shape[0]))
    assert not of_kind(problem.with_data(data), "sign")


def late_columns(problem: Problem) -> list[Finding]:
    return list(check_late(fit(simulator(problem), effort=Effort(end="intervals"))))


@pytest.mark.slow
@pytest.mark.parametrize(("column", "samples"), [("current", 12), ("speed", 5)])
def test_a_column_on_a_late_clock_is_told_by_a_fit(noisy, column: str, samples: int) -> None:
    def delayed(x: np.ndarray) -> np.ndarray:
        return np.concatenate([np.full(samples, x[0]), x[:-samples]])

    problem = changed(noisy(0), column, delayed)
    found = late_columns(problem)
    assert [(f.kind, f.column, f.severity) for f in found] == [("clock", column, "error")]
    late = float(found[0].text.partition("late = ")[2].split()[0])
    assert late == pytest.approx(1e-3 * samples, abs=1e-4)


@pytest.mark.slow
def test_a_late_column_is_no_fault_where_something_else_is_wrong_too(noisy) -> None:
    """It is a delay among what is missing then: laws are asked.

    Alone it is a fault, see the test above.
    """

    def delayed(x: np.ndarray) -> np.ndarray:
        return np.concatenate([np.full(12, x[0]), x[:-12]])

    problem = changed(noisy(0), "current", delayed)
    sigma = problem.sigma[[c.name for c in problem.channels].index("current")]
    noise = np.random.default_rng(5)
    # the mean square of two channels is 1.5 where one has twice the variance; this one has 4
    louder = changed(
        problem, "current", lambda x: x + np.sqrt(3.0) * sigma * noise.normal(size=x.size)
    )
    assert late_columns(louder) == []


@pytest.mark.slow
def test_inputs_that_come_after_what_they_cause(noisy) -> None:
    problem = noisy(0)
    runs = []
    for run in problem.runs:
        values = np.asarray(run.inputs["motor.w_ref"].at(run.times))
        late = np.concatenate([np.full(10, values[0]), values[:-10]])
        table = Table(run.times, late, text=f"{run.name}:speed_set")
        runs.append(replace(run, inputs={"motor.w_ref": table}))
    found = late_columns(problem.changed(runs=runs))
    assert [(f.kind, f.column) for f in found] == [("clock", "speed_set")]
    assert "after what it causes" in found[0].text
    assert late_columns(problem) == []


def test_many_runs_with_one_finding_are_one_line() -> None:
    found = [Finding("warning", "gaps", f"r{k}", "x", f"lacks {k} %") for k in range(9)]
    said = "warning: run r0 x: lacks 0 % (so, too, in 8 other runs: r1, …, r8)"
    assert lines(found) == [said]
    of_all = replace(found[0], run="")
    assert lines([*found, of_all]) == [said]  # what is said of all runs is no run
    assert len(lines(found[:3])) == 3


@pytest.mark.parametrize(
    ("made", "model", "named"),
    [
        (lambda x, noise: np.clip(x + noise, -2.0, 2.0), lambda x: x, ["largest", "smallest"]),
        (lambda x, noise: np.minimum(x + noise, 2.0), lambda x: 0.9 * x, ["largest"]),
        (lambda x, noise: x + noise, lambda x: x, []),
        # the machine has a limit, and its sensor noise
        (lambda x, noise: np.clip(x, -2.0, 2.0) + noise, lambda x: x, []),
        # a command that its controller limits, as in the model
        (lambda x, noise: np.clip(x + noise, -2.0, 2.0), lambda x: np.clip(x, -2.0, 2.0), []),
        # rounding hides the noise
        (lambda x, noise: np.round(2.0 * (x + noise)) / 2.0, lambda x: 1.2 * x, []),
    ],
    ids=["both sides", "one side", "none", "the machine's", "the model's too", "rounded"],
)
def test_a_column_that_ends_at_a_limit_which_the_model_goes_beyond(made, model, named) -> None:
    true = 3.0 * np.sin(np.linspace(0.0, 30.0, 3000))
    noise = 0.05 * np.random.default_rng(4).standard_normal(true.size)
    run: Any = SimpleNamespace(name="A", data=made(true, noise)[:, None])
    channel = SimpleNamespace(name="current", unit="A", sigma=0.05)
    problem: Any = SimpleNamespace(runs=[run], channels=[channel])
    found = list(check_clipped(problem, {"A": model(true)[:, None]}))
    assert [f.text.split()[3] for f in found] == named
    if len(named) == 2:
        way = "limit = 1.999998 in [columns], converted to the unit that the column has in the log"
        assert all(f"{way}, if that is not in A" in f.text for f in found)
    else:  # limit would take good values of the other side
        assert all("empty their cells in the log" in f.text for f in found)


@pytest.mark.parametrize("both", [True, False])
def test_a_column_of_another_run(noisy, both: bool) -> None:
    """Exchanged between two runs, or taken from one that keeps it."""
    problem = noisy(0)
    column = [c.name for c in problem.channels].index("current")
    data = {run.name: run.data.copy() for run in problem.runs}
    data["stairs"][:, column] = problem.run("sines").data[:, column]
    if both:
        data["sines"][:, column] = problem.run("stairs").data[:, column]
    found = [f for f in examine(simulator(problem.with_data(data))) if f.severity == "error"]
    expected = ("swapped", "sines") if both else ("mixed", "stairs")
    assert [(f.kind, f.run, f.column) for f in found] == [(*expected, "current")]
    assert ("run stairs" if both else "that of run sines") in found[0].text


def test_a_motion_that_comes_again_has_noise_of_its_own(noisy) -> None:
    first, second = noisy(0), noisy(1)
    data = {**{r.name: r.data for r in first.runs}, "check": second.run("sines").data}
    found = findings(first.with_data(data))
    assert not {f.kind for f in found} & {"mixed", "copy"}
