"""What every fidelity with a winding shares: sensors and the machine itself."""

from __future__ import annotations

from .. import dc_motor as qs
from ..model import SX, Model


def sensors(m: Model, current: SX, speed: SX, command: SX) -> tuple[SX, SX, SX]:
    """What the loops see of current, speed and command, with the effects on these signals."""
    sensed_current = (
        current
        + m.balance(
            "current_sensor", "signal", unit="A", value=current, sensor=qs.I_MEASURED
        ).effort
    )
    sensed_speed = speed + m.balance("speed_sensor", "signal", unit="rad/s", value=speed).effort
    command = command + m.balance("command", "signal", unit="rad/s", value=command).effort
    return sensed_current, sensed_speed, command


def machine(m: Model, i: SX, measured: SX, voltage: SX, w: SX) -> None:
    """Winding, torque, outputs and energy of the machine for a given terminal voltage.

    L di/dt = u - R i - K w,   tau = K i - b_m w
    """
    p = m.parameters(qs.R_A, qs.L_A, qs.K_T, qs.B_M)
    # One constant for torque and back-EMF, whatever an effect does to it: their powers cancel.
    ripple = m.balance(
        "torque_constant",
        "coefficient",
        unit="N.m/A",
        value=p.K_t,
        current=i,
        turning=w,
    )
    k_t = p.K_t + ripple.effort
    winding = m.balance(
        "winding",
        "winding",
        current=i,
        speed=w,
        voltage=voltage,
        resistance=p.R_a,
        emf_constant=k_t,
    )
    m.derivative(
        i,
        (voltage - p.R_a * i - k_t * w + winding.effort) / p.L_a,
    )
    shaft = m.balance("shaft", "rotation", velocity=w, load=k_t * i)
    tau = k_t * i - p.b_m * w + shaft.effort
    m.output(qs.TAU, tau)
    m.output(qs.I, i)
    m.output(qs.U, voltage)
    m.output(qs.I_MEASURED, measured)
    m.port(qs.SHAFT, tau, w)
    m.supply(voltage * i)
    m.stored_energy(p.L_a * i**2 / 2)
    m.loss("winding", p.R_a * i**2)
    m.loss("bearings", p.b_m * w**2)
