"""Every scenario runs, its checks hold, and what its README says of it is so."""

from __future__ import annotations

from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cosim.running.plots import plot_overview
from cosim.running.runner import run
from cosim.scenario.scenario import find, scenario_files
from tests.scenarios.running import PROVIDER, whole

pytestmark = pytest.mark.slow

FILES = {file.name: file for file in scenario_files()}


@pytest.mark.parametrize("name", FILES)
def test_checks_hold(name: str) -> None:
    result = whole(name)
    assert not [label for label, check in result.checks.items() if not check.ok]
    for item in result.runs.values():
        assert np.isfinite(item.recording.values).all()


@pytest.mark.parametrize("name", FILES)
def test_a_scenario_says_what_it_asks_and_where_its_limits_come_from(name: str) -> None:
    file = FILES[name]
    readme = (file.path.parent / "README.md").read_text(encoding="utf-8")
    assert readme.startswith(f"# {name}\n") and "\nQuestion: " in readme
    item = file.scenario(next(iter(file.runs)))
    assert item.text and item.question and item.expected and item.source
    for run_name in file.runs:
        assert all(len(check.source) > 5 for check in file.scenario(run_name).checks)


@pytest.mark.parametrize("name", FILES)
def test_a_picture_of_the_first_run(name: str, tmp_path: Path) -> None:
    result = next(iter(whole(name).runs.values()))
    figure = result.plot(tmp_path / "plot.png")
    assert matplotlib.image.imread(tmp_path / "plot.png").std() > 0.01  # not one colour
    for axes in figure.get_axes():
        assert axes.get_xlabel() or axes is not figure.get_axes()[-1]
        assert "[" in axes.get_ylabel() or axes.get_ylabel()


# -- crawler_paper ---------------------------------------------------------------------------------


def test_the_overview_of_the_crawler_compares_with_the_printed_table(tmp_path: Path) -> None:
    quantities = whole("crawler_paper").overview
    figure = plot_overview(quantities, "title", tmp_path / "overview.png")
    assert [axes.get_ylabel() for axes in figure.get_axes()] == ["[m]", "[rad/s]", "", ""]
    radius = quantities[0]
    assert radius.cases == ("e of the run", "e of the other runs", "e = 0")
    # Table 2, first and last row
    assert radius.marks["SET1_1"] == 0.1195 and radius.marks["SET5_3"] == 0.1444
    head, rows = radius.rows()
    assert head[:2] == ["radius of the path of S [m]", "measured (Table 2)"] and len(rows) == 16


def test_e_of_the_other_runs_is_their_mean() -> None:
    file, _ = find("crawler_paper")
    values = file.scenario("SET4_2").parameters
    # rows 1 and 3 of SET4 in Table 2
    assert values["others.e_right"] == pytest.approx((0.0435 + 0.0429) / 2, rel=1e-12)
    assert values["others.e_left"] == pytest.approx((-0.0018 + 0.0004) / 2, rel=1e-12)


def test_printed_path_errors_are_passed_by_other_runs_and_not_by_the_own_one() -> None:
    checks = whole("crawler_paper").checks
    passed = {"quarter": 0, "full": 0}
    for name, check in checks.items():
        for turn in passed:
            if f"path after a {turn} turn, e of the other runs" in name:
                own = checks[name.replace("other runs", "run")]
                assert own.ok and isinstance(own.limit, float)
                passed[turn] += check.value > own.limit
    assert passed == {"quarter": 8, "full": 15}  # as the README says


# -- ur5_bench -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("run_name", "inertia"), [("UR5e", 9.034227 / 2), ("UR5", 7.429714 / 2)])
def test_joint_1_alone_in_continuous_time(run_name: str, inertia: float) -> None:
    """The expected values of the bench; the inertias are M_z of pinocchio at 2 rad/s2."""
    kp, ki, kd, t_f = 500.0, 400.0, 2.0, 1 / (2 * np.pi * 400)
    gear, eta, k_t, r_a, l_a, friction = 101.0, 0.8, 0.12, 0.5, 6e-4, 8.0
    total = inertia + gear**2 * 1e-4

    def angle(t: float) -> float:
        s = min(max(t, 0.0), 1.0)
        return 0.5 * (10 * s**3 - 15 * s**4 + 6 * s**5)

    def rates(t: float, x: np.ndarray) -> list[float]:
        q, w, current, integral, filtered = x
        error = angle(t) - q
        u = kp * error + integral + kd * (error - filtered) / t_f
        return [
            w,
            (gear * eta * k_t * current - friction * w) / total,
            (u - r_a * current - k_t * gear * w) / l_a,
            ki * error,
            (error - filtered) / t_f,
        ]

    times = np.linspace(0.0, 2.0, 2001)
    found = solve_ivp(rates, (0, 2), [0.0] * 5, "BDF", times, rtol=1e-8, atol=1e-10)
    error = np.array([angle(t) for t in times]) - found.y[0]
    expected = {
        check.name: check.expected for check in FILES["ur5_bench"].scenario(run_name).checks
    }
    # printed in the scenario to five digits
    assert expected["largest error of joint 1"] == pytest.approx(np.abs(error).max(), rel=1e-4)
    left = expected["error of joint 1 one second after the move"]
    assert left == pytest.approx(-error[-1], rel=1e-3)
    assert expected["peak current of joint 1"] == pytest.approx(found.y[2].max(), rel=1e-4)


def test_bench_converges_to_it_with_the_step() -> None:
    errors = []
    for step in (1e-3, 5e-4):
        result = run(
            "ur5_bench/UR5e", provider=PROVIDER, algorithm="jacobi", step=step, duration=2.2
        )
        recording = result.recording
        lag = np.abs(recording["arm.q[1]"] - recording["path.q_set[1]"]).max()
        errors.append(abs(lag - 0.0199018))
    assert errors[1] < 0.7 * errors[0]  # first order: half, on a grid of 2 ms


# -- mobile manipulator ----------------------------------------------------------------------------


def test_the_swinging_arm_shifts_the_base_sideways() -> None:
    """README: 2.5 mm in IY and 3.2 mm in CY, where an independent simulation has 2.8 mm."""
    still = {"arm_path.amplitude": [0.0] * 6}
    for name, expected in (("IY", 2.5e-3), ("CY", 3.2e-3)):
        moving = whole("mobile_manipulator").runs[name].recording
        resting = run(f"mobile_manipulator/{name}", provider=PROVIDER, parameters=still).recording
        x, y = (moving[key] - resting[key] for key in ("base.x", "base.y"))
        heading = resting["base.phi"]
        sideways = np.cos(heading) * y - np.sin(heading) * x
        steady = (moving.time > 5.0) & (moving.time < 11.0)
        # half a unit of the README's last digit
        assert np.ptp(sideways[steady]) == pytest.approx(expected, abs=0.06e-3)


@pytest.mark.parametrize("name", ["IN1", "IY"])
def test_the_mobile_manipulator_stands_at_rest_with_all_its_mass(name) -> None:
    """83 kg of base, 15 kg of cabinet, 20.6 kg of arm with flange; no current before the path."""
    recording = run(f"mobile_manipulator/{name}", provider=PROVIDER, duration=0.5).recording
    mass = sum(recording[f"base.loads[{i}]"] for i in range(1, 7)) / 9.81
    assert mass == pytest.approx(118.6, abs=0.02)  # started off its rest: 112 to 125 kg
    for side in ("left", "right"):  # 0.72 A from a level start; 8 mA lean on the start of IY's arm
        assert np.abs(recording[f"current_{side}.i_meas"]).max() < 0.02


def test_a_stiff_hold_of_the_arm_can_be_exchanged_at_the_scenarios_step() -> None:
    """`drive=perfect` swung itself up at 1 ms with parabolas and stopped at 0.789 s."""
    coarse, fine = (
        run(
            "mobile_manipulator/IY", provider=PROVIDER, variants={"drive": "perfect"},
            step=step, duration=3.0,
        ).recording
        for step in (1e-3, 2.5e-4)
    )  # fmt: skip
    for name, noise in (("base.phi", 0.05e-3), ("arm.q[4]", 0.05e-3), ("drive.i[2]", 30e-3)):
        assert np.abs(coarse[name] - fine[name]).max() < noise  # 3 urad, 0.5 urad, 15 mA seen
    assert np.ptp(coarse["base.phi"]) > 1e-3


def test_coupling_error_of_the_mobile_manipulator_shrinks_with_the_step() -> None:
    """README: largest difference of the heading to 0.125 ms; the first 4 s hold two swings."""
    courses = {
        step: run("mobile_manipulator/IY", provider=PROVIDER, step=step, duration=4.0).recording
        for step in (1.25e-4, 1e-3)
    }
    fine, coarse = courses[1.25e-4], courses[1e-3]
    np.testing.assert_allclose(fine.time, coarse.time, atol=1e-9)
    assert np.abs(fine["base.phi"] - coarse["base.phi"]).max() < 0.13e-3  # README: 0.12 mrad
    assert np.abs(coarse["base.phi"]).max() > 10e-3  # and there is something to see


def test_a_slipping_drive_wheel_needs_gauss_seidel_at_a_millisecond() -> None:
    """README of mir250: Jacobi passes the torque on three steps late and becomes unstable."""
    peaks = {
        algorithm: np.abs(
            run("mir250_casters/friction_1.0", provider=PROVIDER, algorithm=algorithm)
            .recording["motor_right.i"]
        ).max()
        for algorithm in ("gauss_seidel", "jacobi")
    }  # fmt: skip
    assert peaks["gauss_seidel"] < 12.0  # 11.6 A, as with 0.06 ms
    assert peaks["jacobi"] > 20.0
