"""Eccentric wheel or sprocket: its rolling radius changes over a turn.

    r -> r + e cos(phi - phi_0)

Not modelled: higher harmonics of the rim.

Source: kinematics of an eccentric circle, to first order in e.
"""

from __future__ import annotations

import casadi as ca

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.angle import shaft_angle
from ..quantity import Quantity

E = Quantity(
    "e", "m", "amplitude of the radius, 0 = absent", start=5e-4, nominal=1e-3, strength=True
)
PHI_0 = Quantity(
    "phi_0", "rad", "wheel angle at which the radius is largest", hints=SearchHints(mix="turn")
)

EFFECT = Effect(
    "wheel_runout",
    "Eccentric wheel or sprocket.",
    ("coefficient",),
    E,
    unit="m",
    source="kinematics",
)


def law(e: EffectModel) -> None:
    """Modulate the radius."""
    p, phi = e.parameters(E, PHI_0), shaft_angle(e, "turning")
    e.add(p.e * ca.cos(phi - p.phi_0))
