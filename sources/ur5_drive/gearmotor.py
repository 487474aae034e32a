"""What the fidelities of the drive share: sensors, windings, gears and their account of energy."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import casadi as ca

from ..model import SX, Model
from . import (
    CURRENT,
    ETA,
    F_SENSOR,
    I_MEASURED,
    J_B,
    J_M,
    JOINT,
    K_T,
    L_A,
    Q_MEASURED,
    Q_SET,
    QD,
    QD_SET,
    R_A,
    SENSED,
    TAU,
    B,
    I,
    N,
    Q,
    U,
)


class Servo(NamedTuple):
    """What the controllers see, with what effects do to it, and the true joint motion."""

    q_set: SX
    qd_set: SX
    q: SX
    qd: SX
    angle: SX
    speed: SX


def effort(m: Model, name: str, kind: str, unit: str = "", **signals: SX) -> SX:
    """Open a balance for all six joints and one for each; what effects add to them."""
    together = m.balance(name, kind, unit=unit, **signals)
    single = [
        m.balance(
            f"{name}_{i + 1}", kind, unit=unit, **{key: value[i] for key, value in signals.items()}
        ).effort
        for i in range(6)
    ]
    return together.effort + ca.vertcat(*single)


def read(m: Model) -> Servo:
    """Declare the inputs and let effects disturb command and sensors."""
    q_set, qd_set = m.input(Q_SET), m.input(QD_SET)
    q, qd = m.input(Q), m.input(QD)
    m.input_rate(q, qd)
    command = ca.vertcat(q_set, qd_set)
    command = command + m.balance("command", "bundle", value=command).effort
    reading = q + effort(m, "encoder", "signal", "rad", value=q)
    speed = qd + effort(m, "speed_sensor", "signal", "rad/s", value=qd)
    m.output(Q_MEASURED, reading)
    return Servo(command[:6], command[6:], reading, speed, q, qd)


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
    current = m.state(CURRENT)
    resistance, inductance, constant = m.parameter(R_A), m.parameter(L_A), m.parameter(K_T)
    ratio = m.parameter(N)
    emf = constant * ratio
    disturbance = effort(
        m,
        "winding",
        "winding",
        current=current,
        speed=ratio * qd,
        voltage=voltage,
        resistance=resistance,
        emf_constant=constant,
    )
    m.derivative(current, (voltage - resistance * current - emf * qd + disturbance) / inductance)
    m.supply(ca.dot(voltage, current))
    m.stored_energy(ca.dot(inductance, current**2) / 2)
    m.loss("winding", ca.dot(resistance, current**2))
    m.output(I, current)
    m.output(U, voltage)
    output_current(m, current)
    return Winding(ratio, current, resistance, inductance, emf, disturbance)


def output_current(m: Model, current: SX) -> None:
    """Current sensors of first order."""
    sensed = m.state(SENSED)
    m.derivative(sensed, 2 * math.pi * m.parameter(F_SENSOR) * (current - sensed))
    m.output(I_MEASURED, sensed + effort(m, "current_sensor", "signal", "A", value=sensed))


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
    eta, friction = m.parameter(ETA), m.parameter(B)
    friction = friction + effort(m, "friction", "coefficient", "N.m.s/rad", value=friction)
    motor = coils.emf * (coils.current if acting is None else acting)
    share = factor(eta, motor * servo.speed)
    driving = share * motor
    torque = driving - friction * servo.speed
    torque = torque + effort(
        m, "joint", "rotation", velocity=servo.speed, angle=servo.angle, load=driving
    )
    m.output(TAU, torque)
    m.output(J_B, coils.ratio**2 * m.parameter(J_M))
    m.port(JOINT, torque, servo.speed)
    m.loss("gears", ca.dot((1 - share) * motor, servo.speed))
    m.loss("bearings", ca.dot(friction, servo.speed**2))
    if acting is not None:
        m.supply(ca.dot(motor - coils.emf * coils.current, servo.speed))
