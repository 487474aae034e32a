"""The servo drives: printed figures of the whole, loop margins, the rig's tick, gear losses."""

from __future__ import annotations

from functools import lru_cache
from math import pi

import casadi as ca
import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sources.function import Oracle
from sources.variant import device_values
from tests.arm.chains import Reference, laws, named, vector
from tests.support import Stepper, oracle_of

pytestmark = pytest.mark.slow

STRETCHED = np.array([pi / 2, -0.1, 0.2, -0.1 - pi / 2, -pi / 2, 0])
SIZES = {"size 3": 0, "size 1": 3}  # first joint of each


@lru_cache(maxsize=None)
def oracle(variant: str) -> Oracle:
    return oracle_of(variant)


def gravity_torques(device: str, q: np.ndarray) -> np.ndarray:
    zero = np.zeros(3)
    up = np.array([0, 0, 9.81])
    tau, _ = laws(device)["inverse"](q, np.zeros(6), np.zeros(6), zero, up, zero)
    return np.asarray(tau).ravel()


def value(device: str, name: str) -> np.ndarray:
    return np.array(device_values("ur5_drive", device)[name].value, dtype=float)


# -- the whole: path, servo, gear, arm ----------------------------------------------------------


def joined(arm: str, drive: str, path: str) -> tuple[ca.Function, Oracle, Oracle]:
    """One differential equation of arm and drive: (t, x_arm, x_drive, p_path) -> rates, signals."""
    a, d, p = oracle(arm), oracle(drive), oracle(path)
    t, x_a, x_d = ca.SX.sym("t"), ca.SX.sym("x_a", len(a.state_names)), ca.SX.sym("x_d", 24)
    start_a, start_d, start_p = a.arguments(), d.arguments(), p.arguments()

    def outputs(model: Oracle, y: ca.SX, name: str) -> ca.SX:
        return ca.vertcat(*[y[model.output_names.index(f"{name}[{k}]")] for k in range(1, 7)])

    def inputs(model: Oracle, **signals: ca.SX) -> ca.SX:
        given = {f"{n}[{k + 1}]": s[k] for n, s in signals.items() for k in range(6)}
        return ca.vertcat(*[given.get(v.name, v.start) for v in model.model.of_role("input")])

    motion = a.functions.outputs(t, x_a, start_a[2], start_a[3], start_a[4])[1]
    q, qd = outputs(a, motion, "q"), outputs(a, motion, "qd")
    parameters = ca.SX.sym("p", len(start_p[4]))
    command = p.functions.outputs(t, [], [], [], parameters)[1]
    q_set, qd_set = outputs(p, command, "q_set"), outputs(p, command, "qd_set")
    u_d = inputs(d, q_set=q_set, qd_set=qd_set, q=q, qd=qd)
    rate_d, y_d = d.functions.outputs(t, x_d, start_d[2], u_d, start_d[4])
    u_a = inputs(a, tau=outputs(d, y_d, "tau"), J_added=outputs(d, y_d, "J_b"))
    rate_a = a.functions.derivatives(t, x_a, start_a[2], u_a, start_a[4])
    x, f = ca.vertcat(x_a, x_d), ca.vertcat(rate_a, rate_d)
    results = [f, ca.jacobian(f, x), q_set - q, outputs(d, y_d, "i")]
    return ca.Function("joined", [t, x, parameters], results), a, d


def set_motion_current(path: Oracle, parameters: np.ndarray) -> float:
    """Largest current of joint 1 if it followed the path exactly, by inverse dynamics."""
    reference, up = Reference("ur5e"), np.array([0, 0, 9.81, 0, 0, 0])
    largest = 0.0
    for t in np.linspace(0, 1, 101):
        y = np.asarray(path.functions.outputs(t, [], [], [], parameters)[1]).ravel()
        tau, _ = reference.inverse(y[:6], y[6:12], y[12:], np.zeros(3), up)
        gears = tau + 101**2 * value("ur5", "J_m") * y[12:] + value("ur5", "b") * y[6:12]
        current = gears / (101 * value("ur5", "eta") * value("ur5", "K_t"))
        largest = max(largest, abs(current[0]))
    return largest


def test_half_a_radian_in_one_second() -> None:
    """UR5e stretched, joint 1 moves by 0.5 rad in 1 s: printed figures of a full simulation."""
    f, a, d = joined("ur5_arm.ur5e/rigid", "ur5_drive/servo", "joint_trajectory/quintic")
    path = oracle("joint_trajectory/quintic")
    parameters = path.arguments({"t_start": 0.0, "duration": 1.0})[4]
    hold = gravity_torques("ur5e", STRETCHED) / (101 * value("ur5", "eta") * value("ur5", "K_t"))
    x0 = np.concatenate(
        [
            a.arguments(named(angle=STRETCHED))[1],
            d.arguments(named(current=hold, sensed=hold, integral=value("ur5", "R_a") * hold))[1],
        ]
    )
    times = np.linspace(0, 2, 401)
    result = solve_ivp(
        lambda t, x: np.asarray(f(t, x, parameters)[0]).ravel(),
        (0, 2),
        x0,
        method="BDF",
        jac=lambda t, x: np.asarray(f(t, x, parameters)[1]),
        t_eval=times,
        rtol=1e-7,
        atol=1e-9,
    )
    assert result.success
    signals = [f(t, x, parameters) for t, x in zip(times, result.y.T, strict=True)]
    errors = np.array([np.asarray(s[2]).ravel() for s in signals])
    currents = np.array([np.asarray(s[3]).ravel() for s in signals])
    # half of the last printed digit
    assert np.abs(errors[:, 0]).max() == pytest.approx(19.9e-3, abs=0.05e-3)
    assert np.abs(errors[:, 1:]).max() <= 0.1e-3
    assert np.abs(errors[-1, 0]) == pytest.approx(3.1e-3, abs=0.05e-3)
    assert np.abs(currents[:, 1]).max() == pytest.approx(6.3, abs=0.05)
    # printed 2.0 A: that is what the set motion needs, the lagging servo takes a little more
    assert set_motion_current(path, parameters) == pytest.approx(2.04, abs=0.01)
    assert np.abs(currents[:, 0]).max() == pytest.approx(2.09, abs=0.01)


def test_holding_current_depends_on_the_efficiency_law() -> None:
    """Constant eta needs the torque over eta; the signed law at standstill only the torque."""
    torque = gravity_torques("ur5e", STRETCHED)[1]
    lossless = abs(torque) / (101 * value("ur5", "K_t")[1])
    # printed: 6.3 A, and 4.9 A at the start of a run with the signed law
    assert lossless / value("ur5", "eta")[1] == pytest.approx(6.3, abs=0.05)
    assert lossless == pytest.approx(5.06, abs=0.005)
    current = np.zeros(6)
    current[1] = torque / (101 * value("ur5", "K_t")[1])
    given = oracle("ur5_drive/servo_lossy").outputs(named(current=current))
    assert given["tau[2]"] == pytest.approx(torque, rel=1e-12)  # rounding


# -- loops --------------------------------------------------------------------------------------


def loop(joint: int, load: float) -> control.FrequencyResponseData:
    """Open loop of one joint from its angle error to its angle, with 1 ms of delay."""
    drive = oracle("ur5_drive/servo")
    arguments = drive.arguments()
    functions = drive.functions
    x, u = ca.SX.sym("x", 24), ca.SX.sym("u", 24)
    rate, y = functions.outputs(0, x, arguments[2], u, arguments[4])
    tau = y[drive.output_names.index(f"tau[{joint + 1}]")]
    at = {"x": arguments[1], "u": arguments[3]}
    inputs = [12 + joint, 18 + joint]  # q, qd
    matrices = ca.Function(
        "m",
        [x, u],
        [ca.jacobian(rate, x), ca.jacobian(rate, u), ca.jacobian(tau, x), ca.jacobian(tau, u)],
    )(at["x"], at["u"])
    a, b, c, d = (np.asarray(m) for m in matrices)
    inertia = load + drive.outputs()[f"J_b[{joint + 1}]"]
    # plant inertia q'' = tau with the speed path closed: states [drive, q, qd]
    n = 24
    big = np.zeros((n + 2, n + 2))
    big[:n, :n] = a
    big[:n, n + 1] = b[:, inputs[1]]
    big[n, n + 1] = 1.0
    big[n + 1, :n] = c / inertia
    big[n + 1, n + 1] = d[0, inputs[1]] / inertia
    drive_in = np.zeros((n + 2, 1))
    drive_in[:n, 0] = -b[:, inputs[0]]  # the error is minus the angle
    drive_in[n + 1, 0] = -d[0, inputs[0]] / inertia
    out = np.zeros((1, n + 2))
    out[0, n] = 1.0
    system = control.ss(big, drive_in, out, 0)
    omega = np.logspace(-1, 3, 4000)
    response = system(1j * omega) * np.exp(-1j * omega * 1e-3)
    return control.frd(response, omega, smooth=True)


def by_hand(joint: int, load: float) -> tuple[float, float]:
    """Crossover [Hz] and phase margin [deg] of the loop's transfer function written out."""
    k_t, r, inductance, eta, b, j_m, kp, ki, kd = (
        value("ur5", k)[joint] for k in ("K_t", "R_a", "L_a", "eta", "b", "J_m", "Kp", "Ki", "Kd")
    )
    omega = 2 * pi * np.logspace(0, 2, 20001)
    s = 1j * omega
    pid = kp + ki / s + kd * s / (1 + s / (2 * pi * 400))
    winding, shaft = inductance * s + r, (load + 101**2 * j_m) * s + b
    motor = 101 * eta * k_t / (shaft * winding + 101**2 * eta * k_t**2) / s
    opened = pid * motor * np.exp(-s * 1e-3)
    k = int(np.argmax(np.abs(opened) < 1))
    return omega[k] / (2 * pi), 180 + np.degrees(np.angle(opened[k]))


@pytest.mark.parametrize(
    ("size", "load", "crossover", "margin"),
    [
        # printed elsewhere from the same data: 6.3 Hz 83 deg, 5.3 Hz 58 deg, 5.9 Hz 86-87 deg
        ("size 3", 0.5, 6.30, 81.4),
        ("size 3", 4.5, 5.22, 56.6),
        ("size 1", 0.0, 5.90, 85.6),
    ],
)
def test_loop_margins(size: str, load: float, crossover: float, margin: float) -> None:
    """With 1 ms of delay; load without the rotor."""
    joint = SIZES[size]
    _, phase, _, omega = control.margin(loop(joint, load))
    frequency, angle = by_hand(joint, load)
    assert omega / (2 * pi) == pytest.approx(frequency, rel=1e-3)  # grids of 0.05 % and 0.2 %
    assert phase == pytest.approx(angle, abs=0.05)
    # the last digit above
    assert frequency == pytest.approx(crossover, abs=0.006)
    assert angle == pytest.approx(margin, abs=0.06)


# -- the sampled servo ----------------------------------------------------------------------------


def test_rig_is_repeated_tick_by_tick() -> None:
    """`sampled` before `ticked` against the sheet's sentences, written out with pinocchio."""
    period, q0 = 5e-4, np.array([0.2, -1.2, 1.0, -0.6, 0.4, 0.1])
    drive = {k: v.value for k, v in device_values("ur5_drive", "ur5_lab").items()}
    ratio, k_t, r, inductance, eta, b, j_m, kp, ki, kd = (
        np.array(drive[k]) for k in ("N", "K_t", "R_a", "L_a", "eta", "b", "J_m", "Kp", "Ki", "Kd")
    )
    rotor = ratio**2 * j_m
    hold = gravity_torques("lab", q0) / (ratio * eta * k_t)
    slope = np.array([0.8, -0.5, 1.0, 2.0, -1.5, 3.0])

    reference = Reference("lab")
    q, qd, i, integral = q0.copy(), np.zeros(6), hold.copy(), r * hold
    up = np.array([0, 0, 9.81, 0, 0, 0])

    arm = Stepper("ur5_arm.lab/ticked", named(angle=q0, J_added=rotor))
    servo = Stepper(
        "ur5_drive.ur5_lab/sampled", named(current=hold, sensed=hold, integral=r * hold)
    )
    seen = arm.outputs()
    for k in range(200):
        target = q0 + slope * k * period
        # the sheet
        error = target - q
        u = np.clip(kp * error + integral + kd * (slope - qd), -48, 48)
        integral = integral + ki * error * period
        final = (u - k_t * ratio * qd) / r
        decay = np.exp(-period * r / inductance)
        mean = final + (i - final) * (1 - decay) * inductance / (r * period)
        i = final + (i - final) * decay
        tau = ratio * eta * k_t * mean - b * qd
        bias, _ = reference.inverse(q, qd, np.zeros(6), np.zeros(3), up)
        matrix = reference.mass_matrix(q)[6:, 6:] + np.diag(rotor)
        qd = qd + period * np.linalg.solve(matrix, tau - bias)
        q = q + period * qd
        # the components
        inputs = named(q_set=target, qd_set=slope, q=vector(seen, "q"), qd=vector(seen, "qd"))
        given = servo.step(inputs, period)
        seen = arm.step(named(tau=vector(given, "tau")), period)
        # RK4 errs by (h R/L)^5/120 = 5e-7 per step of h = 0.1 ms, five to a tick, in currents that
        # jump by up to 20 A here; torque and motion inherit that
        np.testing.assert_allclose(vector(given, "i"), i, rtol=0, atol=1e-4)
        np.testing.assert_allclose(vector(seen, "q"), q, rtol=0, atol=1e-8)
        np.testing.assert_allclose(vector(seen, "qd"), qd, rtol=0, atol=1e-5)
    assert np.abs(q - q0).max() > 0.1  # it did move


def test_voltage_limit_holds() -> None:
    servo = Stepper("ur5_drive/sampled", {})
    outputs = servo.step(named(q_set=np.full(6, 1.0)), 5e-4)
    np.testing.assert_array_equal(vector(outputs, "u"), np.full(6, 48.0))
    # continuous twin
    given = oracle("ur5_drive/servo").outputs(named(q_set=np.full(6, -1.0)))
    np.testing.assert_array_equal(vector(given, "u"), np.full(6, -48.0))


# -- gears ---------------------------------------------------------------------------------------


def test_signed_efficiency_never_gains() -> None:
    """On braking the constant factor gives power back, the signed one does not."""
    braking = named(current=np.full(6, 5.0), qd=np.full(6, -1.0))
    driving = named(current=np.full(6, 5.0), qd=np.full(6, 1.0))
    heat = float(value("ur5", "R_a") @ np.full(6, 25.0) + value("ur5", "b") @ np.ones(6))
    power = 101 * value("ur5", "K_t") * 5.0
    for variant, braked in (("servo", -1.0), ("servo_lossy", 1.0)):
        model = oracle(f"ur5_drive/{variant}")
        gears = model.outputs(driving)["P_loss"] - heat
        # P/P_0 is over 100 here: tanh is 1
        assert gears == pytest.approx(float((1 - value("ur5", "eta")) @ power), rel=1e-12)
        lost = model.outputs(braking)["P_loss"] - heat
        assert np.sign(lost) == braked


def test_perfect_servo_holds_the_arm() -> None:
    """Drive and arm in turns of 1 ms: the stretched UR5 sags by less than half a milliradian."""
    arm = Stepper("ur5_arm/rigid", named(angle=STRETCHED))
    drive = Stepper("ur5_drive/perfect", {})
    seen, given = arm.outputs(), drive.outputs()
    arm.set(named(J_added=vector(given, "J_b")))
    for _ in range(400):
        inputs = named(q_set=STRETCHED, q=vector(seen, "q"), qd=vector(seen, "qd"))
        given = drive.step(inputs, 1e-3)
        seen = arm.step(named(tau=vector(given, "tau")), 1e-3)
    sag = vector(seen, "q") - STRETCHED
    # the sheet's stiffness: gravity torque over k
    k = np.array([2e5] * 3 + [2e4] * 3)
    expected = gravity_torques("ur5", STRETCHED) / k
    np.testing.assert_allclose(sag, -expected, rtol=0, atol=2e-6)  # settled to 1 %
    assert np.abs(sag).max() < 5e-4


@pytest.mark.parametrize("fidelity", ["perfect", "servo", "servo_lossy", "sampled"])
def test_finite_at_rest(fidelity: str) -> None:
    model = oracle(f"ur5_drive/{fidelity}")
    arguments = model.arguments()
    seeds = [np.ones(np.size(a)) for a in arguments]
    functions = model.functions
    results = [
        functions.outputs(*arguments),
        functions.jacobian(*arguments),
        functions.directional(*arguments, *seeds),
    ]
    for result in results:
        assert all(np.isfinite(np.asarray(item)).all() for item in result)


@pytest.mark.parametrize(("place", "joints"), [("friction_2", [1]), ("friction", range(6))])
def test_gears_warm_up_since_power_on(place: str, joints: list[int]) -> None:
    """b (1 + k exp(-(t_on + t)/t_w)) at the joints that have it, the others as before."""
    cold = oracle(f"ur5_drive.ur5_lab/sampled+warm_up@{place}")
    moving = {f"qd[{i + 1}]": 0.1 * (i + 1) for i in range(6)}
    own = {"k": 0.5, "t_w": 80.0, "t_on": 30.0}
    friction = value("ur5_lab", "b")
    warm = oracle("ur5_drive.ur5_lab/sampled").outputs(moving, 10.0)
    found = cold.outputs(moving | {f"{place}.warm_up.{n}": v for n, v in own.items()}, 10.0)
    for i in range(6):
        more = -0.5 * np.exp(-0.5) * friction[i] * 0.1 * (i + 1) if i in joints else 0.0
        assert found[f"tau[{i + 1}]"] - warm[f"tau[{i + 1}]"] == pytest.approx(more, rel=1e-9)
