"""Frictionless point that carries weight.

    f_x = f_y = 0,   m_z = tau_f   (it has no fork: the torque acts on the body)

Not modelled: swivel, rolling and friction of the caster; its mass is carried at the pivot.

Source: the support of a planar base model, e.g. Siciliano et al., Robotics, 2009, ch. 11.
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity
from ..model import Model
from . import (
    F_N,
    F_X,
    F_Y,
    F_Z,
    FORK,
    M_F,
    M_W,
    M_Z,
    MASS,
    PIVOT_X,
    PIVOT_Y,
    PSI,
    RELIEF,
    TAU_F,
    V_X,
    V_Y,
    W_F,
    W_Z,
    X_W,
    Y_W,
    YAW,
    W,
)

FIDELITY = Fidelity(level=0)


def equations(m: Model) -> None:
    """Collect the equations."""
    v_x, v_y, w_z, f_n = m.input(V_X), m.input(V_Y), m.input(W_Z), m.input(F_N)
    m.input(X_W)
    m.input(Y_W)
    tau_f = m.input(TAU_F)
    mass = m.output(MASS, m.parameter(M_F) + m.parameter(M_W))
    m.output(RELIEF, ca.SX.zeros(3))
    for quantity in (F_X, F_Y, PSI, W):
        m.output(quantity, 0)
    m.output(F_Z, f_n)
    m.output(M_Z, tau_f)
    m.output(W_F, w_z)
    m.stored_energy(mass * (v_x**2 + v_y**2) / 2)
    m.port(PIVOT_X, 0, v_x)
    m.port(PIVOT_Y, 0, v_y)
    m.port(YAW, tau_f, w_z)
    m.port(FORK, tau_f, w_z)
