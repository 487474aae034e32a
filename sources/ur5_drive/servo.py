"""Continuous PID on the angle error that sets the motor voltage; constant gear efficiency.

    e = q_set - q,   I' = Ki e,   f' = (e - f)/T_f
    u = sat(Kp e + I + Kd (e - f)/T_f, u_max)
    L_a i' = u - R_a i - K_t N qd,   tau = N eta K_t i - b qd,   J_b = N^2 J_m

The factor eta multiplies torque in both directions of power flow, as in the paper; on braking it
gives back power that was never put in. `servo_lossy` repairs that. `qd_set` is not used.

Not modelled: current limit, anti-windup, sampling, elasticity of the gears (`ur5_arm/elastic`).

Source: digital twin paper (UR5 position control and gearmotor blocks).
"""

from __future__ import annotations

import math

import casadi as ca

from .. import ur5_drive as qs
from ..component import Fidelity, Solver
from ..model import SX, Model
from ..quantity import Quantity
from .gearmotor import Servo, gear, read, winding

FIDELITY = Fidelity(level=1, solver=Solver("rodas3", 1e-3))
T_F = Quantity(
    "T_f", "s", "filter time of the derivative", start=1 / (2 * math.pi * 400), minimum=1e-6
)
FILTERED = Quantity("filtered", "rad", "state: filtered angle errors", size=6, nominal=0.01)


def control(m: Model, servo: Servo) -> SX:
    """Voltages of the continuous PID."""
    p = m.parameters(T_F, qs.KI, qs.U_MAX, qs.KP, qs.KD)
    x = m.states(qs.INTEGRAL, FILTERED)
    error = servo.q_set - servo.q
    change = (error - x.filtered) / p.T_f
    m.derivative(x.integral, p.Ki * error)
    m.derivative(x.filtered, change)
    wanted = p.Kp * error + x.integral + p.Kd * change
    return ca.fmax(-p.u_max, ca.fmin(wanted, p.u_max))


def equations(m: Model) -> None:
    """Collect the equations."""
    servo = read(m)
    coils = winding(m, servo.speed, control(m, servo))
    gear(m, servo, coils, lambda eta, power: eta)
