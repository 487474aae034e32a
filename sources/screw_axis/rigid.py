"""Carriage, screw and rotor as one mass with symmetric friction.

    r = lead / (2 pi),   x = r phi
    M r^2 phi'' = tau + r (F_0 - F_v v - F_c tanh(v / v_0)),   v = r phi'

Effects that repeat with the turn of the screw see the angle phi + x_0 / r.

Not modelled: elasticity (`elastic`), friction that depends on direction, place or load (effects).

Source: Janot, Gautier, Brunot, Data set and reference models of EMPS, Workshop on Nonlinear System
Identification Benchmarks, 2019 (M, F_v, F_c and offset).
"""

from __future__ import annotations

import math

import casadi as ca

from ..component import Fidelity, Solver
from ..model import Model
from . import ANGLE, F_0, F_C, F_V, FLANGE, LEAD, MASS, PHI, SPEED, TAU, V_0, X_0, W, X

# L-stable: close to standstill the friction has a time constant of v_0 M / F_c.
FIDELITY = Fidelity(level=0, solver=Solver("rodas3", 1e-3))


def equations(m: Model) -> None:
    """Collect the equations."""
    torque = m.input(TAU)
    radius = m.parameter(LEAD) / (2 * math.pi)
    inertia = m.parameter(MASS) * radius**2
    angle, speed = m.state(ANGLE), m.state(SPEED)
    v = radius * speed
    viscous = m.parameter(F_V) * v
    dry = m.parameter(F_C) * ca.tanh(v / m.parameter(V_0))
    offset = m.parameter(F_0)
    turned = angle + m.parameter(X_0) / radius
    shaft = m.balance("screw", "rotation", velocity=speed, angle=turned, load=torque)
    m.derivative(angle, speed)
    m.derivative(speed, (torque + radius * (offset - viscous - dry) + shaft.effort) / inertia)
    m.output(W, speed)
    m.output(PHI, angle)
    m.output(X, radius * angle)
    m.port(FLANGE, torque, speed)
    m.supply(offset * v)
    m.stored_energy(inertia * speed**2 / 2)
    m.loss("friction", (viscous + dry) * v)
