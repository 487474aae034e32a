"""The motor's loops against linear control theory and against a plain simulation of the rig."""

from __future__ import annotations

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from sources.function import Oracle
from sources.variant import build_model
from tests.drives.closed_drive import ClosedDrive
from tests.support import oracle_of

# One drive of the MiR250 with half of base, cabinet and arm, seen at the motor (straight ahead).
INERTIA = 0.00601
VEHICLE = {"load.J": INERTIA, "load.b": 0.0}
MOTOR = {"K": 0.13, "R": 0.10, "L": 2e-4, "b": 5e-4}
GAINS = {"Kp_v": 1.6, "Ki_v": 8.4, "Kp_i": 0.19, "Ki_i": 94.0}
NO_GAINS = {f"motor.{name}": 0.0 for name in GAINS}
DELAY = 150e-6
S = control.tf("s")


def vehicle(**values: float) -> ClosedDrive:
    named = {f"motor.{name}": value for name, value in values.items()}
    return ClosedDrive("dc_motor/electrical", "inertia/disc", values={**VEHICLE, **named})


def plant() -> tuple[control.TransferFunction, control.TransferFunction]:
    """Voltage to current and current to speed, written independently of the component."""
    shaft = 1 / (INERTIA * S + MOTOR["b"])
    to_speed = MOTOR["K"] * shaft
    to_current = 1 / (MOTOR["L"] * S + MOTOR["R"] + MOTOR["K"] ** 2 * shaft)
    return control.minreal(to_current, verbose=False), to_speed


def test_poles_and_gain_of_motor_and_vehicle() -> None:
    drive = ClosedDrive("dc_motor/electrical", "inertia/disc", values={**VEHICLE, **NO_GAINS})
    a, *_ = drive.matrices()
    index = [drive.states.index(n) for n in ("motor.current", "load.speed")]
    inner = a[np.ix_(index, index)]
    # with gains of 0 the integrator of the current loop is the voltage
    voltage = a[np.ix_(index, [drive.states.index("motor.current_integral")])]
    poles = np.sort(np.linalg.eigvals(inner).real)
    # half a unit of the last digit of -470 1/s, -30.0 1/s and 7.67 rad/s per V
    assert poles[0] == pytest.approx(-470.0, abs=0.5)
    assert poles[1] == pytest.approx(-30.0, abs=0.05)
    gain = -np.linalg.solve(inner, voltage)[1, 0]
    assert abs(gain - 7.67) < 0.005


@pytest.mark.slow
@pytest.mark.parametrize("derivative", [(0.0, 0.0), (0.02, 2e-5)], ids=["PI", "PID"])
def test_step_is_that_of_the_linear_loop(derivative: tuple[float, float]) -> None:
    kd_v, kd_i = derivative
    t_fv, t_fi, t_ref = 1e-3, 1e-4, 1e-3
    drive = vehicle(Kd_v=kd_v, Kd_i=kd_i, acc_max=1e6)
    to_current, to_speed = plant()
    speed_loop = GAINS["Kp_v"] + GAINS["Ki_v"] / S + kd_v * S / (1 + t_fv * S)
    current_loop = GAINS["Kp_i"] + GAINS["Ki_i"] / S + kd_i * S / (1 + t_fi * S)
    inner = control.feedback(control.ss(current_loop * to_current), 1)
    closed = control.feedback(control.ss(speed_loop) * inner * control.ss(to_speed), 1)
    expected = closed * control.ss(1 / (1 + t_ref * S))

    times = np.linspace(0.0, 0.4, 81)
    step = 2.0  # rad/s, small enough to stay off every limit
    _, reference = control.forced_response(expected, times, np.full(times.size, step))
    run = solve_ivp(
        lambda _, x: np.asarray(drive.rate(x, [], step)).ravel(),
        (0.0, times[-1]),
        drive.start,
        method="Radau",
        t_eval=times,
        rtol=1e-9,
        atol=1e-10,
    )
    speed = run.y[drive.states.index("load.speed")]
    # ten times the relative tolerance of the solver
    np.testing.assert_allclose(speed, reference, atol=1e-8 * step)


def loops(drive: ClosedDrive, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Open loops and closed speed loop with the amplifier's delay, from the model's linearization.

    All transfers come from the same set speed, so their ratios do not depend on the outer loop.
    """
    speed, current, _, set_current, _ = drive.response(omega)
    closed = current / set_current
    delay = np.exp(-1j * omega * DELAY)
    current_loop = closed / (1 - closed) * delay
    inner = current_loop / (1 + current_loop)
    set_speed = 1 / (1 + 1j * omega * 1e-3)
    speed_loop = set_current / (set_speed - speed) * inner * speed / current
    return current_loop, speed_loop, speed_loop / (1 + speed_loop)


def wheel_drive(**values: float) -> ClosedDrive:
    """Motor, gearbox and wheel of the MiR250; the published check values count the gear's loss."""
    named = {name.replace("_", ".", 1): value for name, value in values.items()}
    return ClosedDrive("dc_motor/electrical", "inertia.mir250/disc", "gearbox/ratio", named)


@pytest.mark.slow
def test_margins_with_the_delay_of_the_amplifier() -> None:
    omega = np.logspace(-1, 5, 6001)
    current_loop, speed_loop, closed = loops(wheel_drive(), omega)
    gain, phase, _, crossover = control.margin(control.frd(current_loop, omega))
    # all tolerances: one unit of the last digit of the published check values
    assert abs(crossover / (2 * np.pi) - 152) < 1
    assert abs(phase - 82) < 1
    assert abs(gain - 11) < 1
    _, phase, _, crossover = control.margin(control.frd(speed_loop, omega))
    assert abs(crossover / (2 * np.pi) - 4.9) < 0.1
    assert abs(phase - 79) < 1
    bandwidth = omega[np.flatnonzero(np.abs(closed) > 1 / np.sqrt(2))[-1]] / (2 * np.pi)
    assert abs(bandwidth - 5.8) < 0.1


def test_overshoot_of_the_speed_loop() -> None:
    a, b, c, d = wheel_drive(motor_T_ref=1e-5).matrices()
    _, response = control.step_response(control.ss(a, b, c[:1], d[:1]), np.linspace(0, 1, 2001))
    assert abs(response.max() - 1.10) < 0.01  # published 10 %, one unit of its last digit


def test_lifted_wheel_is_stable() -> None:
    """Only rotor and wheel left: published crossover 85 Hz, phase margin 78 degrees."""
    omega = np.logspace(0, 5, 6001)
    _, speed_loop, _ = loops(wheel_drive(load_J=0.00716), omega)
    _, phase, _, crossover = control.margin(control.frd(speed_loop, omega))
    assert abs(crossover / (2 * np.pi) - 85) < 1  # one unit of the last digit
    assert abs(phase - 78) < 2  # two units: 76.5 here, what the published one leaves out is unknown


def test_integrators_stop_at_the_limit_and_the_right_hand_side_is_continuous() -> None:
    oracle = oracle_of("dc_motor/electrical")
    limit, gain, integral_gain = 41.4, GAINS["Kp_v"], GAINS["Ki_v"]

    def rate(error: float) -> float:
        return oracle.derivatives({"set_speed": error})["speed_integral"]

    below, above = 0.999 * limit / gain, 1.03 * limit / gain
    assert rate(below) == pytest.approx(integral_gain * below, rel=1e-12)
    assert rate(above) == 0.0
    errors = np.linspace(below, above, 200)
    rates = np.array([rate(e) for e in errors])
    slope = np.abs(np.diff(rates)).max() / (errors[1] - errors[0])
    assert slope < 2 * integral_gain / 0.02  # Ki e falls to 0 over 2 % of the limit: finite slope


def plain_rig(command: np.ndarray, p: dict[str, float]) -> np.ndarray:
    """Plain numpy simulation of the motor bench as its sheet describes it: w, i, u per 50 us."""
    t_i, t_v, ratio = 50e-6, 500e-6, 10.167
    inertia = p["J_load"] + ratio**2 * p["J_m"]
    a = np.array(
        [
            [-p["R"] / p["L"], -p["K"] * ratio / p["L"]],
            [ratio * p["eta"] * p["K"] / inertia, -p["b"] / inertia],
        ]
    )
    # exact solution over a period with constant voltage
    exact = expm(np.block([[a, np.array([[1 / p["L"]], [0.0]])], [np.zeros((1, 3))]]) * t_i)
    i = w_out = set_limited = i_v = i_i = u = i_set = 0.0
    rows = []
    for k, set_speed in enumerate(command):
        w = ratio * w_out
        rows.append((w, i, u, i_set))
        if k % 10 == 0:
            change = p["acc_max"] * t_v
            set_limited += min(max(set_speed - set_limited, -change), change)
            e = set_limited - w
            wanted = p["Kp_v"] * e + i_v
            i_set = min(max(wanted, -p["i_max"]), p["i_max"])
            if abs(wanted) < p["i_max"]:
                i_v += p["Ki_v"] * e * t_v
        e = i_set - i
        wanted = p["Kp_i"] * e + i_i
        u = min(max(wanted, -p["u_max"]), p["u_max"])
        if abs(wanted) < p["u_max"]:
            i_i += p["Ki_i"] * e * t_i
        i, w_out, _ = exact @ (i, w_out, u)
    return np.array(rows)


BENCH = {
    "R": 0.35, "L": 4e-4, "K": 0.095, "J_m": 1.6e-4, "eta": 0.82, "b": 0.06, "J_load": 0.08,
    "Kp_v": 0.4, "Ki_v": 4.0, "Kp_i": 0.80, "Ki_i": 560.0, "acc_max": 1500.0,
    "i_max": 30.0, "u_max": 48.0,
}  # fmt: skip


@pytest.mark.parametrize(
    ("limits", "reaches"),
    [({}, "none"), ({"i_max": 18.0}, "current"), ({"u_max": 12.0}, "voltage")],
    ids=["free", "current limit", "voltage limit"],
)
def test_sampled_loops_are_those_of_the_rig_sheet(limits: dict[str, float], reaches: str) -> None:
    command = np.concatenate([np.full(1500, 120.0), np.full(2500, -60.0)])
    parameters = {**BENCH, **limits}
    reference = plain_rig(command, parameters)
    drive = ClosedDrive(
        "dc_motor.lab_bench/sampled",
        "inertia.lab_bench/disc",
        "gearbox.lab_bench/ratio",
        values={f"motor.{name}": value for name, value in limits.items()},
    )
    got = drive.sampled_run(command, 50e-6)[:, :4]
    at_limit = {
        "current": np.abs(reference[:, 3]).max() == parameters["i_max"],
        "voltage": np.abs(reference[:, 2]).max() == parameters["u_max"],
    }
    assert [name for name, hit in at_limit.items() if hit] == (
        [] if reaches == "none" else [reaches]
    )
    # RK4 with 50 us steps on a 1.1 ms winding against the exact solution leaves 1e-7
    np.testing.assert_allclose(got, reference, atol=5e-7, rtol=0)


def test_sampled_derivative_is_that_of_the_filtered_error() -> None:
    """A ramp of the error settles at Kd times its slope, whatever the filter."""
    model = build_model("dc_motor/sampled")
    oracle = Oracle(model)
    kd, slope, period = 0.05, 30.0, 5e-4
    values = {"Kp_v": 0.0, "Ki_v": 0.0, "Kd_v": kd, "acc_max": 1e9}
    names = [v.name for v in model.of_role("discrete")]
    for k in range(60):
        arguments = oracle.arguments({**values, "w_ref": slope * k * period})
        held = np.asarray(oracle.functions.updates[0](*arguments)).ravel()
        values.update(zip(names, held.tolist(), strict=True))
    # the filter (1 ms) has settled to exp(-60 * 0.5 / 1.5) after 60 ticks
    assert values["set_current"] == pytest.approx(kd * slope, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("fidelity", ["ideal", "electrical", "sampled"])
def test_every_fidelity_reaches_the_set_speed(fidelity: str) -> None:
    drive = ClosedDrive(
        f"dc_motor.lab_bench/{fidelity}", "inertia.lab_bench/disc", "gearbox.lab_bench/ratio"
    )
    target = 40.0
    if fidelity == "sampled":
        final = drive.sampled_run(np.full(30000, target), 50e-6)[-1]
    else:
        run = solve_ivp(
            lambda _, x: np.asarray(drive.rate(x, [], target)).ravel(),
            (0.0, 1.5),
            drive.start,
            method="Radau",
            rtol=1e-6,
        )
        final = np.asarray(drive.outputs(run.y[:, -1], [], target)).ravel()
    friction = 0.06 / (10.167**2 * 0.82)  # viscous friction as the motor sees it
    share = 0.1 / (0.1 + friction) if fidelity == "ideal" else 1.0
    # the slowest loop (Ki_v / Kp_v = 10 1/s) has settled to 3e-7 of the step after 1.5 s
    assert final[0] == pytest.approx(share * target, rel=1e-5)
    assert final[1] == pytest.approx(friction * share * target / 0.095, rel=1e-3)


def test_ideal_source_is_limited_in_acceleration_and_torque() -> None:
    oracle = oracle_of("dc_motor/ideal")
    assert oracle.derivatives({"w_ref": 100.0})["set_speed"] == 50.8
    assert oracle.derivatives({"w_ref": -100.0})["set_speed"] == -50.8
    assert oracle.outputs({"set_speed": 100.0})["tau"] == pytest.approx(0.13 * 41.4, rel=1e-15)
