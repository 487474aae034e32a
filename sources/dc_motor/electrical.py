"""Winding with continuous, nested PI(D) loops for speed and current.

    w_set' = sat((w_ref - w_set) / T_ref, acc_max)
    e_v = w_set - w,     i_set = sat(Kp_v e_v + I_v + Kd_v (e_v - f_v) / T_fv, i_max)
    I_v' = h Ki_v e_v,   f_v' = (e_v - f_v) / T_fv
    e_i = i_set - i,     u = sat(Kp_i e_i + I_i + Kd_i (e_i - f_i) / T_fi, u_max)
    I_i' = h Ki_i e_i,   f_i' = (e_i - f_i) / T_fi
    L_a i' = u - R_a i - K_t w,   tau = K_t i - b_m w

Integrators stop while their output is limited: h falls from 1 to 0 over the first 2 % beyond the
limit, so that the right-hand side stays continuous. The derivatives act on the errors, filtered.

Not modelled: sampling and dead time of the loops (`sampled`), switching, inductance that varies.

Source: digital twin paper (motor subsystem, two nested loops called PID; gains not printed);
anti-windup by conditional integration, Åström and Hägglund, Advanced PID Control, 2006, ch. 3.5.
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity, Solver
from ..model import SX, Model
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
    T_REF,
    U_MAX,
    W_REF,
    W,
)
from .machine import machine, sensors

# Current loops of some 1000 rad/s; effects on the winding (brushes) can be much faster than that.
# The limits make kinks; a fixed step would miss them, or be short all the time.
FIDELITY = Fidelity(level=1, solver=Solver("rodas3_adaptive", 1e-3, 3e-5))
BAND = 0.02


def equations(m: Model) -> None:
    """Collect the equations."""
    command, speed = m.input(W_REF), m.input(W)
    current = m.state(CURRENT)
    current_integral, current_filter = m.state(CURRENT_INTEGRAL), m.state(CURRENT_FILTER)
    speed_integral, speed_filter = m.state(SPEED_INTEGRAL), m.state(SPEED_FILTER)
    set_speed = m.state(SET_SPEED)
    sensed_current, sensed_speed, command = sensors(m, current, speed, command)

    acc_max = m.parameter(ACC_MAX)
    m.derivative(
        set_speed,
        ca.fmax(-acc_max, ca.fmin((command - set_speed) / m.parameter(T_REF), acc_max)),
    )

    def loop(error: SX, integral: SX, filtered: SX, gains: tuple[SX, SX, SX, SX], limit: SX) -> SX:
        kp, ki, kd, t_f = gains
        rate = (error - filtered) / t_f
        wanted = kp * error + integral + kd / t_f * (error - filtered)
        rest = 1 / BAND + 1 - 1 / BAND / limit * ca.fabs(wanted)
        m.derivative(integral, ki * error * ca.fmax(0, ca.fmin(rest, 1)))
        m.derivative(filtered, rate)
        return ca.fmax(-limit, ca.fmin(wanted, limit))

    gains = (m.parameter(KP_V), m.parameter(KI_V), m.parameter(KD_V), m.parameter(T_FV))
    error = set_speed - sensed_speed
    i_set = loop(error, speed_integral, speed_filter, gains, m.parameter(I_MAX))
    gains = (m.parameter(KP_I), m.parameter(KI_I), m.parameter(KD_I), m.parameter(T_FI))
    error = i_set - sensed_current
    voltage = loop(error, current_integral, current_filter, gains, m.parameter(U_MAX))
    m.output(I_SET, i_set)
    machine(m, current, sensed_current, voltage, speed)
