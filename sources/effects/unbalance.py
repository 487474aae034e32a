"""Unbalance: a weight that is eccentric on a horizontal shaft.

    f = -m_u sin(theta + psi),   E = m_u (1 - cos(theta + psi))

Conservative. The inertia of the weight is counted by the load.

Not modelled: centrifugal force on the bearings.

Source: weight times lever arm.
"""

from __future__ import annotations

import casadi as ca

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.angle import shaft_angle
from ..quantity import Quantity

M_U = Quantity(
    "m_u", "N.m", "weight times its distance from the axis, 0 = absent", start=0.2, strength=True
)
PSI = Quantity(
    "psi", "rad", "angle of the weight from below at shaft angle 0", hints=SearchHints(mix="turn")
)

EFFECT = Effect(
    "unbalance",
    "Eccentric weight on a horizontal shaft.",
    ("rotation",),
    M_U,
    source="weight times lever arm",
)


def law(e: EffectModel) -> None:
    """Add the moment of the weight."""
    p, theta = e.parameters(M_U, PSI), shaft_angle(e, "velocity")
    argument = theta + p.psi
    e.add(-p.m_u * ca.sin(argument))
    e.stored_energy(p.m_u * (1 - ca.cos(argument)))
    e.loss(0)
