"""What the communication step adds does not move parameters, or is said."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from cosim.calibrate import Problem, read_problem
from cosim.calibrate.calibration import TENTH, calibrated
from cosim.calibrate.fit import fit
from cosim.calibrate.simulator import Simulator
from cosim.cli.app import app
from cosim.cli.calibrate import _far
from cosim.errors import InputError, UnknownNameError
from tests.problems import simulator
from tests.tiny_fmus import V, tiny

K, D, SIGMA, STEP = 40.0, 0.3, 0.1, 0.01
"""Spring [N/m], damper [N.s/m], noise [m] of a mass of 1 kg, communication step [s]."""
SYSTEM = """
connections = ["spring.F -> mass.F", "mass.x -> spring.x", "mass.v -> spring.v"]
[instances]
mass = "mass.fmu"
spring = "spring.fmu"
"""
MAPPING = """
system = "system.toml"
step = 0.01
algorithm = "gauss_seidel"
MORE
[channels]
x = { signal = "mass.x", sigma = 0.1 }
[[parameter]]
name = "k"
unit = ""
nominal = 35
min = 20
max = 80
targets = "spring.k"
[[parameter]]
name = "d"
unit = ""
nominal = 0.5
min = 0.0
max = 2.0
targets = "spring.d"
[[run]]
name = "R"
file = "r.csv"
purpose = "identification"
"""


def oscillator(folder: Path, *, shortest: float = 0.0) -> None:
    """A mass that integrates a held force exactly, on a spring in an FMU of its own."""
    refused = f"if (h < {shortest}) return 3; " if shortest else ""
    tiny(
        folder,
        [V("F", "Float64", "input", "0"), V("x", "Float64", "output"), V("v", "Float64", "output")],
        step=refused + "double F = v->r[0][0]; v->r[1][0] += v->r[2][0] * h + 0.5 * F * h * h; "
        "v->r[2][0] += F * h;",
        begin="v->r[1][0] = 1.0;",
        name="mass",
    )
    tiny(
        folder,
        [
            V("x", "Float64", "input", "0"), V("v", "Float64", "input", "0"),
            V("k", "Float64", "parameter", "40"), V("d", "Float64", "parameter", "0.3"),
            V("F", "Float64", "output"),
        ],
        "v->r[4][0] = -v->r[2][0] * v->r[0][0] - v->r[3][0] * v->r[1][0];",
        name="spring",
    )  # fmt: skip
    (folder / "system.toml").write_text(SYSTEM)


def closed_form(times: np.ndarray) -> np.ndarray:
    """x'' = -k x - d x' from x = 1 at rest."""
    frequency = np.sqrt(K - D**2 / 4)
    return np.exp(-D / 2 * times) * (
        np.cos(frequency * times) + D / (2 * frequency) * np.sin(frequency * times)
    )


def data_set(
    folder: Path, *, more: str = "", exact: np.ndarray | None = None, sigma: float = SIGMA
) -> Problem:
    """Noisy measurements of the oscillator, or of other values."""
    times = 0.02 * np.arange(501)
    values = closed_form(times) if exact is None else exact
    values = values + sigma * np.random.default_rng(1).normal(size=times.size)
    lines = [f"{t:.3f},{x:.8f}" for t, x in zip(times, values, strict=True)]
    (folder / "r.csv").write_text("\n".join(["time,x", *lines]))
    (folder / "dataset.toml").write_text(MAPPING.replace("MORE", more).replace("0.1", str(sigma)))
    return read_problem(folder)


def holds(estimate, name: str, value: float) -> bool:
    place = estimate.problem.index(name)
    return bool(estimate.low[place] <= value <= estimate.high[place])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("oscillator")
    oscillator(place)
    return place


def test_plain_exchange_moves_the_damping_and_the_corrected_fit_holds_it(folder: Path) -> None:
    problem = data_set(folder)
    plain = fit(Simulator(problem))
    # a force held over a step is half a step late: d - k h / 2 acts, so the fit makes up 0.2
    assert plain.values["d"] == pytest.approx(D + K * STEP / 2, abs=0.05)
    assert not holds(plain, "d", D)
    estimate, exchange = calibrated(Simulator(problem))
    assert exchange.corrected and exchange.small
    assert exchange.moved["d"] > 10.0  # deviations
    assert "moves d by" in str(exchange)
    assert holds(estimate, "d", D) and holds(estimate, "k", K)
    # intervals are those of the noise: as narrow as in the plain fit, but for a tenth
    width = [e.high - e.low for e in (estimate, plain)]
    assert np.all(width[0] < (1.0 + 2 * TENTH) * width[1])


def test_what_cannot_be_taken_off_widens_the_intervals(folder: Path) -> None:
    problem = data_set(folder, sigma=SIGMA / 100)
    estimate, exchange = calibrated(Simulator(problem))
    assert not exchange.small and "intervals are wider" in str(exchange)
    assert exchange.unsure["d"] > TENTH
    assert holds(estimate, "d", D) and holds(estimate, "k", K)


def test_options_of_the_algorithm_are_those_of_a_scenario(folder: Path) -> None:
    plain = calibrated(Simulator(data_set(folder)))[1]
    problem = data_set(folder, more="options = { extrapolation = 1 }")
    estimate, exchange = calibrated(Simulator(problem))
    assert problem.options == {"extrapolation": 1}
    # second order instead of first: k h^2 against h
    assert exchange.channels["x"] < 0.2 * plain.channels["x"]
    assert holds(estimate, "d", D) and holds(estimate, "k", K)


def test_a_rig_that_exchanges_in_ticks_is_left_alone(folder: Path) -> None:
    problem = data_set(folder, more=f"tick = {STEP}")
    exact = Simulator(problem).simulate(np.array([K, D]), "R")[:, 0]
    problem = data_set(folder, more=f"tick = {STEP}", exact=exact)
    estimate, exchange = calibrated(Simulator(problem))
    assert not exchange.corrected and "ticks" in str(exchange)
    assert holds(estimate, "d", D) and holds(estimate, "k", K)
    # the same data, taken for those of a machine without ticks
    other, _ = calibrated(Simulator(problem.changed(tick=None)))
    assert not holds(other, "d", D)


def test_nothing_is_taken_off_where_the_step_adds_nothing(folder: Path) -> None:
    problem = data_set(folder).changed(step=STEP / 1024)  # 0.0002 of 0.3
    few = problem.runs[0]
    problem = problem.changed(
        runs=[type(few)(few.name, few.purpose, few.times[:25], few.data[:25], few.inputs)]
    )
    plain = fit(Simulator(problem))
    estimate, exchange = calibrated(Simulator(problem))
    assert not exchange.corrected and exchange.small
    assert np.array_equal(estimate.theta, plain.theta)


def test_an_fmu_that_takes_no_finer_step_is_said(tmp_path: Path) -> None:
    oscillator(tmp_path, shortest=0.009)
    problem = data_set(tmp_path)
    estimate, exchange = calibrated(Simulator(problem))
    assert np.array_equal(estimate.theta, fit(Simulator(problem)).theta)
    assert "could not be measured" in str(exchange) and "mass" in str(exchange)
    assert not exchange.small  # what is not known is not small


def test_the_command_says_what_the_step_adds(folder: Path) -> None:
    data_set(folder)
    out = folder / "out"
    run = CliRunner().invoke(app, ["calibrate", str(folder), "--samples", "0", "--out", str(out)])
    assert run.exit_code == 0, run.output
    assert "taken off by steps down to" in " ".join(run.output.split())
    content = json.loads((out / "calibration.json").read_text())
    assert content["exchange"]["corrected"] and content["exchange"]["moved"]["d"] > 10.0
    low, high = content["parameters"]["d"]["ci95"]
    assert low <= D <= high


def test_what_does_not_hold_in_other_runs_is_said() -> None:
    def channel(fitted: float, unused: float | None) -> dict[str, float | None]:
        return {"noise_rms": 0.1, "identification": fitted, "validation": unused}

    def same() -> dict[str, float]:
        return {"a": 12.0, "b": 9.0}

    assert _far({"a": channel(0.11, 0.12), "b": channel(0.1, None)}, same) == []
    [line] = _far({"a": channel(0.11, 0.12), "b": channel(0.1, 0.9)}, same)
    assert line.startswith(
        "in runs that were not fitted it leaves 9 times the noise in b, in those"
    )
    [line] = _far({"a": channel(0.5, 0.6), "b": channel(0.1, 0.1)}, same)
    assert line.startswith("the model leaves 5 times the noise in a: it lacks something")
    assert len(_far({"a": channel(0.5, 1.5), "b": channel(0.1, 0.1)}, same)) == 2
    explained = {"a": 1.0, "b": 5.0}
    [line] = _far({"a": channel(0.1, 0.3), "b": channel(0.1, 0.1)}, lambda: explained)
    assert line.startswith("in runs that were not fitted a is off by 3 times its noise, which is")
    [line] = _far({"a": channel(0.1, 0.9), "b": channel(0.1, 0.5)}, lambda: explained)
    assert line.startswith("in runs that were not fitted it leaves 5 times the noise in b, in")
    # where fitted runs hold more than noise, or runs turn unstable, intervals say nothing of it
    lines = _far({"a": channel(0.4, 2.0), "b": channel(0.1, 0.1)}, lambda: explained)
    assert lines[0].startswith("the model leaves 4 times") and "another kind" in lines[1]
    [line] = _far({"a": channel(0.1, 0.3), "b": channel(0.1, 0.1)}, None)
    assert "another kind" in line


@pytest.mark.parametrize(
    ("more", "error", "text"),
    [
        ('options = { extrapolaton = 1 }', UnknownNameError, "did you mean 'extrapolation'"),
        ('options = { extrapolation = 7 }', InputError, "extrapolation"),
        ('extrapolation = 2', InputError, "write options.extrapolation = 2"),
    ],
)  # fmt: skip
def test_wrong_options_are_named(folder: Path, more: str, error: type, text: str) -> None:
    with pytest.raises(error) as caught:
        data_set(folder, more=more)
    assert text in str(caught.value) and "dataset.toml" in str(caught.value)


def test_a_misspelt_algorithm_is_named(folder: Path) -> None:
    data_set(folder)
    path = folder / "dataset.toml"
    path.write_text(path.read_text().replace("gauss_seidel", "gauss_siedel"))
    with pytest.raises(UnknownNameError, match="gauss_seidel"):
        read_problem(folder)


def test_samples_between_recorded_points_are_not_read_off_lines_across_jumps(
    short: Problem, truth: np.ndarray
) -> None:
    """Clocks jitter: every other sample comes a third of the interval late, voltages jump."""
    whole = short.run("stairs")
    coarse = whole.times[::20]
    late = coarse + np.where(np.arange(coarse.size) % 2, 0.007, 0.0)  # on the whole log's samples
    places = np.searchsorted(whole.times, late[:-1] - 1e-6)
    run = replace(whole, times=late[:-1], data=whole.data[places])
    read = simulator(short.changed(runs=[run])).simulate(truth, run)
    exact = simulator(short.changed(runs=[whole])).simulate(truth, whole)[places]
    voltage = [c.name for c in short.channels].index("voltage")
    rms = float(np.sqrt(np.mean((read - exact)[:, voltage] ** 2))) / short.sigma[voltage]
    assert rms < 1.0  # 0.47; 3.1 by lines over whole intervals
