"""What every fidelity with a winding shares: sensors and the machine itself."""

from __future__ import annotations

from ..model import SX, Model
from . import B_M, I_MEASURED, K_T, L_A, R_A, SHAFT, TAU, I, U


def sensors(m: Model, current: SX, speed: SX, command: SX) -> tuple[SX, SX, SX]:
    """What the loops see of current, speed and command, with the effects on these signals."""
    sensed_current = current + m.balance("current_sensor", "signal", unit="A", value=current).effort
    sensed_speed = speed + m.balance("speed_sensor", "signal", unit="rad/s", value=speed).effort
    command = command + m.balance("command", "signal", unit="rad/s", value=command).effort
    return sensed_current, sensed_speed, command


def machine(m: Model, current: SX, measured: SX, voltage: SX, speed: SX) -> None:
    """Winding, torque, outputs and energy of the machine for a given terminal voltage.

    L di/dt = u - R i - K w,   tau = K i - b_m w
    """
    resistance, inductance = m.parameter(R_A), m.parameter(L_A)
    constant, friction = m.parameter(K_T), m.parameter(B_M)
    # One constant for torque and back-EMF, whatever an effect does to it: their powers cancel.
    ripple = m.balance(
        "torque_constant",
        "coefficient",
        unit="N.m/A",
        value=constant,
        current=current,
        speed=speed,
    )
    constant = constant + ripple.effort
    winding = m.balance(
        "winding",
        "winding",
        current=current,
        speed=speed,
        voltage=voltage,
        resistance=resistance,
        emf_constant=constant,
    )
    m.derivative(
        current,
        (voltage - resistance * current - constant * speed + winding.effort) / inductance,
    )
    shaft = m.balance("shaft", "rotation", velocity=speed, load=constant * current)
    torque = constant * current - friction * speed + shaft.effort
    m.output(TAU, torque)
    m.output(I, current)
    m.output(U, voltage)
    m.output(I_MEASURED, measured)
    m.port(SHAFT, torque, speed)
    m.supply(voltage * current)
    m.stored_energy(inductance * current**2 / 2)
    m.loss("winding", resistance * current**2)
    m.loss("bearings", friction * speed**2)
