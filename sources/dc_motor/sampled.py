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

from ..component import Fidelity, Solver
from ..model import SX, Clock, Model
from ..quantity import Quantity
from . import (
    ACC_MAX,
    CURRENT,
    CURRENT_FILTER,
    CURRENT_INTEGRAL,
    I_MAX,
    I_SET,
    KD_I,
    KD_V,
    KI_I,
    KI_V,
    KP_I,
    KP_V,
    SET_SPEED,
    SPEED_FILTER,
    SPEED_INTEGRAL,
    T_FI,
    T_FV,
    U_MAX,
    W_REF,
    W,
)
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
    command, speed = m.input(W_REF), m.input(W)
    current = m.state(CURRENT)
    sensed_current, sensed_speed, command = sensors(m, current, speed, command)
    t_speed, t_current = m.parameter(T_SPEED), m.parameter(T_CURRENT)
    speed_tick, current_tick = m.clock("speed_loop", t_speed), m.clock("current_loop", t_current)
    set_speed, set_current = m.discrete(SET_SPEED), m.discrete(SET_CURRENT)
    speed_integral, speed_filter = m.discrete(SPEED_INTEGRAL), m.discrete(SPEED_FILTER)
    voltage = m.discrete(SET_VOLTAGE)
    current_integral, current_filter = m.discrete(CURRENT_INTEGRAL), m.discrete(CURRENT_FILTER)

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

    change = m.parameter(ACC_MAX) * t_speed
    limited = set_speed + ca.fmax(-change, ca.fmin(command - set_speed, change))
    m.update(speed_tick, set_speed, limited)
    gains = (m.parameter(KP_V), m.parameter(KI_V), m.parameter(KD_V), m.parameter(T_FV))
    error = limited - sensed_speed
    limit = m.parameter(I_MAX)
    loop(speed_tick, t_speed, error, speed_integral, speed_filter, gains, limit, set_current)
    gains = (m.parameter(KP_I), m.parameter(KI_I), m.parameter(KD_I), m.parameter(T_FI))
    error = set_current - sensed_current
    limit = m.parameter(U_MAX)
    loop(current_tick, t_current, error, current_integral, current_filter, gains, limit, voltage)
    m.output(I_SET, set_current)
    machine(m, current, sensed_current, voltage, speed)
