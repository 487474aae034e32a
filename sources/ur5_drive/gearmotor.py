"""What the fidelities of the drive share: sensors, windings, gears and their account of energy."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import casadi as ca

from .. import ur5_drive as qs
from ..model import SX, Model
from ..quantity import Quantity


class Servo(NamedTuple):
    """What the controllers see, with what effects do to it, and the true joint motion."""

    q_set: SX
    qd_set: SX
    q: SX
    qd: SX
    angle: SX
    speed: SX


def effort(
    m: Model, name: str, kind: str, unit: str = "", *, sensor: Quantity | None = None, **signals: SX
) -> SX:
    """Open a balance for all six joints and one for each; what effects add to them."""
    together = m.balance(name, kind, unit=unit, sensor=sensor, **signals)
    single = [
        m.balance(
            f"{name}_{i + 1}",
            kind,
            unit=unit,
            sensor=sensor,
            **{key: value[i] for key, value in signals.items()},
        ).effort
        for i in range(6)
    ]
    return together.effort + ca.vertcat(*single)


def read(m: Model) -> Servo:
    """Declare the inputs and let effects disturb command and sensors."""
    u = m.inputs(qs.Q_SET, qs.QD_SET, qs.Q, qs.QD)
    m.input_rate(u.q, u.qd)
    command = ca.vertcat(u.q_set, u.qd_set)
    command = command + m.balance("command", "bundle", value=command).effort
    reading = u.q + effort(m, "encoder", "signal", "rad", sensor=qs.Q_MEASURED, value=u.q)
    speed = u.qd + effort(m, "speed_sensor", "signal", "rad/s", value=u.qd)
    m.output(qs.Q_MEASURED, reading)
    return Servo(command[:6], command[6:], reading, speed, u.q, u.qd)


class Winding(NamedTuple):
    """The windings: currents, their constants and what effects add to their voltages."""

    ratio: SX
    current: SX
    resistance: SX
    inductance: SX
    emf: SX
    disturbance: SX


def winding(m: Model, qd: SX, voltage: SX) -> Winding:
    """Declare the windings, L i' = u - R i - K_t N qd, with their losses and stored energy."""
    p = m.parameters(qs.R_A, qs.L_A, qs.K_T, qs.N)
    x = m.states(qs.CURRENT)
    emf = p.K_t * p.N
    disturbance = effort(
        m,
        "winding",
        "winding",
        current=x.current,
        speed=p.N * qd,
        voltage=voltage,
        resistance=p.R_a,
        emf_constant=p.K_t,
    )
    m.derivative(x.current, (voltage - p.R_a * x.current - emf * qd + disturbance) / p.L_a)
    m.supply(ca.dot(voltage, x.current))
    m.stored_energy(ca.dot(p.L_a, x.current**2) / 2)
    m.loss("winding", ca.dot(p.R_a, x.current**2))
    m.output(qs.I, x.current)
    m.output(qs.U, voltage)
    output_current(m, x.current)
    return Winding(p.N, x.current, p.R_a, p.L_a, emf, disturbance)


def output_current(m: Model, current: SX) -> None:
    """Current sensors of first order."""
    p = m.parameters(qs.F_SENSOR)
    x = m.states(qs.SENSED)
    m.derivative(x.sensed, 2 * math.pi * p.f_sensor * (current - x.sensed))
    error = effort(m, "current_sensor", "signal", "A", sensor=qs.I_MEASURED, value=x.sensed)
    m.output(qs.I_MEASURED, x.sensed + error)


def gear(
    m: Model,
    servo: Servo,
    coils: Winding,
    factor: Callable[[SX, SX], SX],
    acting: SX | None = None,
) -> None:
    """Gears with friction: tau = factor N K_t i - b qd.

    Args:
        servo: joint motion.
        coils: the windings.
        factor: (efficiency, power of the motor) -> factor on the motor's torque.
        acting: current that acts as torque, if it is not the winding's own; the power in between
            counts as supplied.
    """
    p = m.parameters(qs.ETA, qs.B, qs.J_M)
    friction = p.b + effort(m, "friction", "coefficient", "N.m.s/rad", value=p.b)
    motor = coils.emf * (coils.current if acting is None else acting)
    share = factor(p.eta, motor * servo.speed)
    driving = share * motor
    torque = driving - friction * servo.speed
    torque = torque + effort(
        m, "joint", "rotation", velocity=servo.speed, angle=servo.angle, load=driving
    )
    m.output(qs.TAU, torque)
    m.output(qs.J_B, coils.ratio**2 * p.J_m)
    m.port(qs.JOINT, torque, servo.speed)
    m.loss("gears", ca.dot((1 - share) * motor, servo.speed))
    m.loss("bearings", ca.dot(friction, servo.speed**2))
    if acting is not None:
        m.supply(ca.dot(motor - coils.emf * coils.current, servo.speed))
