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

from .. import dc_motor as qs
from ..component import Fidelity, Solver
from ..model import Model
from ..quantity import Quantity

FIDELITY = Fidelity(level=0, solver=Solver("rodas3", 1e-3))
K_W = Quantity("k_w", "N.m.s/rad", "stiffness of the servo", start=1.0, minimum=1e-9)


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.W_REF, qs.W)
    p = m.parameters(K_W, qs.K_T, qs.B_M, qs.R_A, qs.I_MAX, qs.ACC_MAX, qs.T_REF)
    x = m.states(qs.SET_SPEED)
    w_set = x.set_speed

    sensor = m.balance("speed_sensor", "signal", unit="rad/s", value=u.w)
    link = m.balance("command", "signal", unit="rad/s", value=u.w_ref)
    m.derivative(
        w_set,
        ca.fmax(-p.acc_max, ca.fmin((u.w_ref + link.effort - w_set) / p.T_ref, p.acc_max)),
    )
    limit = p.K_t * p.i_max
    tau_e = ca.fmax(-limit, ca.fmin(p.k_w * (w_set - u.w - sensor.effort), limit))
    shaft = m.balance("shaft", "rotation", velocity=u.w, load=tau_e)
    tau = tau_e - p.b_m * u.w + shaft.effort
    i = tau_e / p.K_t
    voltage = p.R_a * i + p.K_t * u.w
    m.output(qs.TAU, tau)
    m.output(qs.I, i)
    m.output(qs.U, voltage)
    m.output(qs.I_SET, i)
    m.output(qs.I_MEASURED, i)
    m.port(qs.SHAFT, tau, u.w)
    m.supply(voltage * i)
    m.loss("winding", p.R_a * i**2)
    m.loss("bearings", p.b_m * u.w**2)
