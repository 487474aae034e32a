"""Speed source: a stiff proportional servo with acceleration and torque limit, no winding.

    w_set' = sat((w_ref - w_set) / T_ref, acc_max)
    tau_e  = sat(k_w (w_set - w), K_t i_max),   tau = tau_e - b_m w
    i = tau_e / K_t,   u = R_a i + K_t w

The shaft follows the set speed with the time constant J / k_w and stays behind it by the load
torque over k_w. Torque acts on speed without delay: a driven inertia J in another component bears
communication steps below 2 J / k_w.

Not modelled: winding, control loops, voltage limit.

Source: digital twin paper (motor subsystem, reduced to its purpose); current and voltage are those
of the steady state of the machine.
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity, Solver
from ..model import Model
from ..quantity import Quantity
from . import (
    ACC_MAX,
    B_M,
    I_MAX,
    I_MEASURED,
    I_SET,
    K_T,
    R_A,
    SET_SPEED,
    SHAFT,
    T_REF,
    TAU,
    W_REF,
    I,
    U,
    W,
)

FIDELITY = Fidelity(level=0, solver=Solver("rodas3", 1e-3))
K_W = Quantity("k_w", "N.m.s/rad", "stiffness of the servo", start=1.0, minimum=1e-9)


def equations(m: Model) -> None:
    """Collect the equations."""
    command, speed = m.input(W_REF), m.input(W)
    stiffness, constant, friction = m.parameter(K_W), m.parameter(K_T), m.parameter(B_M)
    resistance, i_max = m.parameter(R_A), m.parameter(I_MAX)
    acc_max, settle = m.parameter(ACC_MAX), m.parameter(T_REF)

    set_speed = m.state(SET_SPEED)
    sensor = m.balance("speed_sensor", "signal", unit="rad/s", value=speed)
    link = m.balance("command", "signal", unit="rad/s", value=command)
    m.derivative(
        set_speed,
        ca.fmax(-acc_max, ca.fmin((command + link.effort - set_speed) / settle, acc_max)),
    )
    limit = constant * i_max
    servo = ca.fmax(-limit, ca.fmin(stiffness * (set_speed - speed - sensor.effort), limit))
    shaft = m.balance("shaft", "rotation", velocity=speed, load=servo)
    torque = servo - friction * speed + shaft.effort
    current = servo / constant
    voltage = resistance * current + constant * speed
    m.output(TAU, torque)
    m.output(I, current)
    m.output(U, voltage)
    m.output(I_SET, current)
    m.output(I_MEASURED, current)
    m.port(SHAFT, torque, speed)
    m.supply(voltage * current)
    m.loss("winding", resistance * current**2)
    m.loss("bearings", friction * speed**2)
