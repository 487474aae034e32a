"""Firmware of a hobby servo: the position error sets the duty of the bridge on a small DC motor.

    every T_loop:  d = sat(k_d (q_ref - phi), 1),   u = d u_supply
    between:       i = (u - K_t w) / R_a,   tau = K_t i,   u is held
    enable < 0.5:  i = 0, the bridge is open

All values are seen at the output shaft, behind the gear: K_t is the motor's constant times ratio.

Not modelled: inductance of the winding (its time constant is far below that of the loop), current
limit, profile generator and integral part of the firmware, losses of the gear (effects).

Source: Duclusaud, Passault, Padois, Ly, Extended friction models for the physics simulation of
servo actuators, ICRA 2025.
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity, Solver
from ..model import Model
from ..quantity import Quantity
from . import PHI, Q_REF, SHAFT, T_LOOP, TAU, U_HELD, U, W

FIDELITY = Fidelity(level=1, solver=Solver("rodas3", 1e-3))
U_SUPPLY = Quantity("u_supply", "V", "voltage of the supply", start=7.4, nominal=10.0)
ENABLE = Quantity("enable", "1", "above 0.5: the bridge is on", start=1.0)
K_D = Quantity("k_d", "1/rad", "duty per position error", start=1.0, minimum=0.0)
K_T = Quantity(
    "K_t", "N.m/A", "torque constant and back-EMF constant at the output shaft", start=0.3,
    minimum=1e-6,
)  # fmt: skip
R_A = Quantity("R_a", "ohm", "resistance of the winding", start=5.0, minimum=1e-6)
I = Quantity("i", "A", "winding current, positive drives forward")  # noqa: E741


def equations(m: Model) -> None:
    """Collect the equations."""
    command, angle, speed = m.input(Q_REF), m.input(PHI), m.input(W)
    m.input_rate(angle, speed)
    supply, enable = m.input(U_SUPPLY), m.input(ENABLE)
    command = command + m.balance("command", "signal", unit="rad", value=command).effort
    sensed = angle + m.balance("angle_sensor", "signal", unit="rad", value=angle).effort
    tick = m.clock("loops", m.parameter(T_LOOP))
    held = m.discrete(U_HELD)
    duty = ca.fmax(-1, ca.fmin(m.parameter(K_D) * (command - sensed), 1))
    m.update(tick, held, duty * supply)

    resistance, constant = m.parameter(R_A), m.parameter(K_T)
    on = ca.if_else(enable > 0.5, 1.0, 0.0)
    nominal = on * (held - constant * speed) / resistance
    # One constant for torque and back-EMF, whatever an effect does to it: their powers cancel.
    constant = (
        constant
        + m.balance(
            "torque_constant",
            "coefficient",
            unit="N.m/A",
            value=constant,
            current=nominal,
            speed=speed,
        ).effort
    )
    plain = on * (held - constant * speed) / resistance
    winding = m.balance(
        "winding",
        "winding",
        current=plain,
        speed=speed,
        voltage=held,
        resistance=resistance,
        emf_constant=constant,
    )
    current = plain + on * winding.effort / resistance
    shaft = m.balance("shaft", "rotation", velocity=speed, angle=angle, load=constant * current)
    torque = constant * current + shaft.effort
    m.output(TAU, torque)
    m.output(U, held)
    m.output(I, current)
    m.port(SHAFT, torque, speed)
    m.supply(on * held * current)
    # effects book their power at the current that flows without them: with no inductance there is
    # no other before they act; what they change of it is the winding's
    m.loss("winding", resistance * current**2 - on * winding.effort * (current - plain))
