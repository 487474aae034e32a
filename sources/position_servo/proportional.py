"""Firmware of a hobby servo: the position error sets the duty of the bridge on a small DC motor.

    every T_loop:  d = sat(k_d (q_ref - phi), 1),   u = d u_supply
    between:       L_a i' = u - R_a i - K_t w,   tau = K_t i,   u is held
    enable < 0.5:  i = 0, the bridge is open, and what the winding holds becomes heat

All values are seen at the output shaft, behind the gear: K_t is the motor's constant times ratio.

The inductance is small: i = (u - K_t w) / R_a after a time far below the loop's period. With it the
current is a state, so that effects on the winding act with the current that flows.

Not modelled: current limit, profile generator and integral part of the firmware, losses of the gear
(effects).

Source: Duclusaud, Passault, Padois, Ly, Extended friction models for the physics simulation of
servo actuators, ICRA 2025.
"""

from __future__ import annotations

import casadi as ca

from .. import position_servo as qs
from ..component import Fidelity, Solver
from ..model import Model
from ..quantity import Quantity

# The current settles within a tenth of a loop's period, effects on it may be faster still.
FIDELITY = Fidelity(level=1, solver=Solver("rodas3_adaptive", 1e-3, 1e-5))
U_SUPPLY = Quantity("u_supply", "V", "voltage of the supply", start=7.4, nominal=10.0)
ENABLE = Quantity("enable", "1", "above 0.5: the bridge is on", start=1.0)
K_D = Quantity("k_d", "1/rad", "duty per position error", start=1.0, minimum=0.0)
K_T = Quantity(
    "K_t", "N.m/A", "torque constant and back-EMF constant at the output shaft", start=0.3,
    minimum=1e-6,
)  # fmt: skip
R_A = Quantity("R_a", "ohm", "resistance of the winding", start=5.0, minimum=1e-6)
L_A = Quantity(
    "L_a", "H", "inductance of the winding; as it stands, a time constant of 0.1 ms", start=5e-4,
    minimum=1e-9, nominal=1e-3,
)  # fmt: skip
CURRENT = Quantity("current", "A", "state: current of the winding")
I = Quantity("i", "A", "winding current, positive drives forward")  # noqa: E741


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.Q_REF, qs.PHI, qs.W, U_SUPPLY, ENABLE)
    p = m.parameters(qs.T_LOOP, K_D, R_A, L_A, K_T)
    x = m.states(CURRENT)
    z = m.discretes(qs.U_HELD)
    m.input_rate(u.phi, u.w)
    q_ref = u.q_ref + m.balance("command", "signal", unit="rad", value=u.q_ref).effort
    phi = u.phi + m.balance("angle_sensor", "signal", unit="rad", value=u.phi).effort
    tick = m.clock("loops", p.T_loop)
    d = ca.fmax(-1, ca.fmin(p.k_d * (q_ref - phi), 1))
    m.update(tick, z.u_held, d * u.u_supply)

    on = ca.if_else(u.enable > 0.5, 1.0, 0.0)
    i = on * x.current
    # One constant for torque and back-EMF, whatever an effect does to it: their powers cancel.
    k_t = (
        p.K_t
        + m.balance(
            "torque_constant", "coefficient", unit="N.m/A", value=p.K_t, current=i, turning=u.w
        ).effort
    )
    winding = m.balance(
        "winding",
        "winding",
        current=i,
        speed=u.w,
        voltage=z.u_held,
        resistance=p.R_a,
        emf_constant=k_t,
    )
    driven = on * (z.u_held - k_t * u.w + winding.effort)
    m.derivative(x.current, (driven - p.R_a * x.current) / p.L_a)
    shaft = m.balance("shaft", "rotation", velocity=u.w, angle=u.phi, load=k_t * i)
    torque = k_t * i + shaft.effort
    m.output(qs.TAU, torque)
    m.output(qs.U, z.u_held)
    m.output(I, i)
    m.port(qs.SHAFT, torque, u.w)
    m.supply(z.u_held * i)
    m.stored_energy(p.L_a * x.current**2 / 2)
    m.loss("winding", p.R_a * x.current**2)
