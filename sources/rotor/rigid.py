"""Rigid shaft with viscous friction.

    phi' = w,   J w' = tau_a + tau_b - b w

Not modelled: unbalance, elasticity of the shaft.

Source: Newton's law for rotation.
"""

from __future__ import annotations

from .. import rotor as qs
from ..component import Fidelity, Solver
from ..model import Model

FIDELITY = Fidelity(level=0, solver=Solver("rodas3", 1e-3))


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.TAU_A, qs.TAU_B)
    p = m.parameters(qs.J, qs.B)
    x = m.states(qs.ANGLE, qs.SPEED)
    phi, w = x.angle, x.speed
    flange = m.balance("flange_a", "rotation", velocity=w, angle=phi, load=u.tau_a)
    m.derivative(phi, w)
    m.derivative(w, (u.tau_a + u.tau_b - p.b * w + flange.effort) / p.J)
    m.output(qs.W, w)
    m.output(qs.PHI, phi)
    m.port(qs.FLANGE_A, u.tau_a, w)
    m.port(qs.FLANGE_B, u.tau_b, w)
    m.stored_energy(p.J * w**2 / 2)
    m.loss("bearings", p.b * w**2)
