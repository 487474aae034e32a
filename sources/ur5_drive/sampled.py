"""Sampled servo with speed feedback; the mean current of each period acts as torque.

    every T:  e = q_set - q,   u = sat(Kp e + I + Kd (qd_set - qd), u_max),   I += Ki e T
              i_mean = i_inf + (i - i_inf) (1 - exp(-T R_a/L_a)) L_a/(T R_a)
              i_inf = (u - K_t N qd)/R_a
    between:  L_a i' = u - R_a i - K_t N qd,   tau = N eta K_t i_mean - b qd,   J_b = N^2 J_m

i_mean is the mean of the coming period for a held speed, known when it begins, so that a master
which steps the drive before the arm, period by period, gives the arm the impulse of that period.
The power that the averaging shifts within a period enters `P_in` and has no mean.

Not modelled: computing time, anti-windup, current limit, elasticity of the gears.

Source: rig sheet ur5_bench; Åström and Wittenmark, Computer-Controlled Systems, 1997, ch. 8.
"""

from __future__ import annotations

import casadi as ca

from .. import ur5_drive as qs
from ..component import Fidelity, Solver
from ..model import Model
from ..quantity import Quantity
from .gearmotor import gear, read, winding

# The 2 kHz sensor is the fastest: 1.26 time constants per step, where RK4 is stable up to 2.8.
FIDELITY = Fidelity(level=3, solver=Solver("rk4", 1e-4))
T = Quantity("T", "s", "period of the servo", start=5e-4, minimum=1e-6, variability="fixed")
VOLTAGE = Quantity("voltage", "V", "terminal voltages, held by the servo", size=6, nominal=10.0)
MEAN_CURRENT = Quantity("mean_current", "A", "mean currents of the present period", size=6)


def equations(m: Model) -> None:
    """Collect the equations."""
    servo = read(m)
    p = m.parameters(T, qs.U_MAX, qs.KP, qs.KD, qs.KI)
    z = m.discretes(VOLTAGE, qs.INTEGRAL, MEAN_CURRENT)
    tick = m.clock("servo", p.T)
    error = servo.q_set - servo.q
    wanted = p.Kp * error + z.integral + p.Kd * (servo.qd_set - servo.qd)
    set_voltage = ca.fmax(-p.u_max, ca.fmin(wanted, p.u_max))
    m.update(tick, z.voltage, set_voltage)
    m.update(tick, z.integral, z.integral + p.Ki * error * p.T)
    coils = winding(m, servo.speed, z.voltage)
    driving = set_voltage - coils.emf * servo.speed + coils.disturbance
    final = driving / coils.resistance
    periods = p.T * coils.resistance / coils.inductance
    share = -ca.expm1(-periods) / periods
    m.update(tick, z.mean_current, final + (coils.current - final) * share)
    gear(m, servo, coils, lambda eta, power: eta, acting=z.mean_current)
