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

from .. import screw_axis as qs
from ..component import Fidelity, Solver
from ..model import Model

# L-stable: close to standstill the friction has a time constant of v_0 M / F_c.
FIDELITY = Fidelity(level=0, solver=Solver("rodas3", 1e-3))


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.TAU)
    p = m.parameters(qs.LEAD, qs.MASS, qs.F_V, qs.F_C, qs.V_0, qs.F_0, qs.X_0)
    x = m.states(qs.ANGLE, qs.SPEED)
    phi, w = x.angle, x.speed
    r = p.lead / (2 * math.pi)
    inertia = p.M * r**2
    v = r * w
    viscous = p.F_v * v
    dry = p.F_c * ca.tanh(v / p.v_0)
    turned = phi + p.x_0 / r
    shaft = m.balance("screw", "rotation", velocity=w, angle=turned, load=u.tau)
    m.derivative(phi, w)
    m.derivative(w, (u.tau + r * (p.F_0 - viscous - dry) + shaft.effort) / inertia)
    m.output(qs.W, w)
    m.output(qs.PHI, phi)
    m.output(qs.X, r * phi)
    m.port(qs.FLANGE, u.tau, w)
    m.supply(p.F_0 * v)
    m.stored_energy(inertia * w**2 / 2)
    m.loss("friction", (viscous + dry) * v)
