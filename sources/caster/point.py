"""Frictionless point that carries weight.

    f_x = f_y = 0,   m_z = tau_f   (it has no fork: the torque acts on the body)

Not modelled: swivel, rolling and friction of the caster; its mass is carried at the pivot.

Source: the support of a planar base model, e.g. Siciliano et al., Robotics, 2009, ch. 11.
"""

from __future__ import annotations

import casadi as ca

from .. import caster as qs
from ..component import Fidelity
from ..model import Model

FIDELITY = Fidelity(level=0)


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.V_X, qs.V_Y, qs.W_Z, qs.F_N, qs.X_W, qs.Y_W, qs.TAU_F)
    p = m.parameters(qs.M_F, qs.M_W)
    mass = m.output(qs.MASS, p.m_f + p.m_w)
    m.output(qs.RELIEF, ca.SX.zeros(3))
    for quantity in (qs.F_X, qs.F_Y, qs.PSI, qs.W):
        m.output(quantity, 0)
    m.output(qs.F_Z, u.f_n)
    m.output(qs.M_Z, u.tau_f)
    m.output(qs.W_F, u.w_z)
    m.stored_energy(mass * (u.v_x**2 + u.v_y**2) / 2)
    m.port(qs.PIVOT_X, 0, u.v_x)
    m.port(qs.PIVOT_Y, 0, u.v_y)
    m.port(qs.YAW, u.tau_f, u.w_z)
    m.port(qs.FORK, u.tau_f, u.w_z)
