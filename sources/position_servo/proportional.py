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

from .. import position_servo as qs
from ..component import Fidelity, Solver
from ..model import Model
from ..quantity import Quantity

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
    u = m.inputs(qs.Q_REF, qs.PHI, qs.W, U_SUPPLY, ENABLE)
    p = m.parameters(qs.T_LOOP, K_D, R_A, K_T)
    z = m.discretes(qs.U_HELD)
    m.input_rate(u.phi, u.w)
    q_ref = u.q_ref + m.balance("command", "signal", unit="rad", value=u.q_ref).effort
    phi = u.phi + m.balance("angle_sensor", "signal", unit="rad", value=u.phi).effort
    tick = m.clock("loops", p.T_loop)
    d = ca.fmax(-1, ca.fmin(p.k_d * (q_ref - phi), 1))
    m.update(tick, z.u_held, d * u.u_supply)

    on = ca.if_else(u.enable > 0.5, 1.0, 0.0)
    nominal = on * (z.u_held - p.K_t * u.w) / p.R_a
    # One constant for torque and back-EMF, whatever an effect does to it: their powers cancel.
    k_t = (
        p.K_t
        + m.balance(
            "torque_constant",
            "coefficient",
            unit="N.m/A",
            value=p.K_t,
            current=nominal,
            turning=u.w,
        ).effort
    )
    plain = on * (z.u_held - k_t * u.w) / p.R_a
    winding = m.balance(
        "winding",
        "winding",
        current=plain,
        speed=u.w,
        voltage=z.u_held,
        resistance=p.R_a,
        emf_constant=k_t,
    )
    i = plain + on * winding.effort / p.R_a
    shaft = m.balance("shaft", "rotation", velocity=u.w, angle=u.phi, load=k_t * i)
    torque = k_t * i + shaft.effort
    m.output(qs.TAU, torque)
    m.output(qs.U, z.u_held)
    m.output(I, i)
    m.port(qs.SHAFT, torque, u.w)
    m.supply(on * z.u_held * i)
    # effects book their power at the current that flows without them: with no inductance there is
    # no other before they act; what they change of it is the winding's
    m.loss("winding", p.R_a * i**2 - on * winding.effort * (i - plain))
