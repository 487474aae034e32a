"""Winding with sampled, nested PI(D) loops, as a servo amplifier computes them.

    every T_speed:    w_set += sat(w_ref - w_set, acc_max T_speed)
                      e = w_set - w,    v = Kp_v e + I_v + Kd_v d,   i_set = sat(v, i_max)
                      I_v += Ki_v e T_speed    unless |v| >= i_max
    every T_current:  e = i_set - i,    v = Kp_i e + I_i + Kd_i d,   u = sat(v, u_max)
                      I_i += Ki_i e T_current  unless |v| >= u_max
    between:          L_a i' = u - R_a i - K_t w,   tau = K_t i - b_m w

where both are due, the speed loop acts first. d is the backward difference of the error behind a
first-order filter, d = (e - f) / (T_f + T), f += T d. The voltage is held between the ticks of the
current loop.

Not modelled: computing time of the loops, switching within the PWM period, quantisation.

Source: digital twin paper (motor subsystem, two nested loops called PID); Åström and Wittenmark,
Computer-Controlled Systems, 1997, ch. 8 for the sampled form.
"""

from __future__ import annotations

import casadi as ca

from .. import dc_motor as qs
from ..component import Fidelity, Solver
from ..model import SX, Clock, Model
from ..quantity import Quantity
from .machine import machine, sensors

# One step per tick of the current loop; L-stable, because effects on the winding can be stiff.
FIDELITY = Fidelity(level=2, solver=Solver("rodas3", 5e-5))
T_SPEED = Quantity(
    "T_speed", "s", "period of the speed loop", start=5e-4, minimum=1e-6, variability="fixed"
)
T_CURRENT = Quantity(
    "T_current", "s", "period of the current loop", start=5e-5, minimum=1e-6, variability="fixed"
)
SET_CURRENT = Quantity("set_current", "A", "set current, held by the speed loop")
SET_VOLTAGE = Quantity("set_voltage", "V", "terminal voltage, held by the current loop")


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.W_REF, qs.W)
    p = m.parameters(
        T_SPEED,
        T_CURRENT,
        qs.ACC_MAX,
        qs.KP_V,
        qs.KI_V,
        qs.KD_V,
        qs.T_FV,
        qs.I_MAX,
        qs.KP_I,
        qs.KI_I,
        qs.KD_I,
        qs.T_FI,
        qs.U_MAX,
    )
    x = m.states(qs.CURRENT)
    z = m.discretes(
        qs.SET_SPEED,
        SET_CURRENT,
        qs.SPEED_INTEGRAL,
        qs.SPEED_FILTER,
        SET_VOLTAGE,
        qs.CURRENT_INTEGRAL,
        qs.CURRENT_FILTER,
    )
    i, w, w_ref = sensors(m, x.current, u.w, u.w_ref)
    speed_tick = m.clock("speed_loop", p.T_speed)
    current_tick = m.clock("current_loop", p.T_current)

    def loop(
        tick: Clock,
        period: SX,
        error: SX,
        integral: SX,
        filtered: SX,
        gains: tuple[SX, SX, SX, SX],
        limit: SX,
        result: SX,
    ) -> None:
        kp, ki, kd, t_f = gains
        rate = (error - filtered) / (t_f + period)
        wanted = kp * error + integral + kd * rate
        free = ca.fabs(wanted) < limit
        m.update(tick, result, ca.fmax(-limit, ca.fmin(wanted, limit)))
        m.update(tick, integral, ca.if_else(free, integral + ki * error * period, integral))
        m.update(tick, filtered, filtered + period * rate)

    change = p.acc_max * p.T_speed
    w_set = z.set_speed + ca.fmax(-change, ca.fmin(w_ref - z.set_speed, change))
    m.update(speed_tick, z.set_speed, w_set)
    gains = (p.Kp_v, p.Ki_v, p.Kd_v, p.T_fv)
    e_v, i_v, f_v = w_set - w, z.speed_integral, z.speed_filter
    loop(speed_tick, p.T_speed, e_v, i_v, f_v, gains, p.i_max, z.set_current)
    gains = (p.Kp_i, p.Ki_i, p.Kd_i, p.T_fi)
    e_i, i_i, f_i = z.set_current - i, z.current_integral, z.current_filter
    loop(current_tick, p.T_current, e_i, i_i, f_i, gains, p.u_max, z.set_voltage)
    m.output(qs.I_SET, z.set_current)
    machine(m, x.current, i, z.set_voltage, u.w)
