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

from .. import dc_motor as qs
from ..component import Fidelity, Solver
from ..model import SX, Model
from .machine import machine, sensors

# Current loops of some 1000 rad/s; effects on the winding (brushes) can be much faster than that.
# The limits make kinks; a fixed step would miss them, or be short all the time.
FIDELITY = Fidelity(level=1, solver=Solver("rodas3_adaptive", 1e-3, 3e-5))
BAND = 0.02


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.W_REF, qs.W)
    p = m.parameters(
        qs.ACC_MAX,
        qs.T_REF,
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
    x = m.states(
        qs.CURRENT,
        qs.CURRENT_INTEGRAL,
        qs.CURRENT_FILTER,
        qs.SPEED_INTEGRAL,
        qs.SPEED_FILTER,
        qs.SET_SPEED,
    )
    w_set = x.set_speed
    i, w, w_ref = sensors(m, x.current, u.w, u.w_ref)

    m.derivative(
        w_set,
        ca.fmax(-p.acc_max, ca.fmin((w_ref - w_set) / p.T_ref, p.acc_max)),
    )

    def loop(error: SX, integral: SX, filtered: SX, gains: tuple[SX, SX, SX, SX], limit: SX) -> SX:
        kp, ki, kd, t_f = gains
        rate = (error - filtered) / t_f
        wanted = kp * error + integral + kd / t_f * (error - filtered)
        rest = 1 / BAND + 1 - 1 / BAND / limit * ca.fabs(wanted)
        m.derivative(integral, ki * error * ca.fmax(0, ca.fmin(rest, 1)))
        m.derivative(filtered, rate)
        return ca.fmax(-limit, ca.fmin(wanted, limit))

    gains = (p.Kp_v, p.Ki_v, p.Kd_v, p.T_fv)
    e_v = w_set - w
    i_set = loop(e_v, x.speed_integral, x.speed_filter, gains, p.i_max)
    gains = (p.Kp_i, p.Ki_i, p.Kd_i, p.T_fi)
    e_i = i_set - i
    u_a = loop(e_i, x.current_integral, x.current_filter, gains, p.u_max)
    m.output(qs.I_SET, i_set)
    machine(m, x.current, i, u_a, u.w)
