"""Mass that is fixed to a body.

    m -> m + m_p,   first moment -> + m_p p,   inertia -> + m_p (|p|^2 1 - p p')

The component adds its weight and its inertia.

Not modelled: extent of the payload (a point mass), sloshing or swinging.

Source: rigid body mechanics.
"""

from __future__ import annotations

import casadi as ca

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

MASS = Quantity("mass", "kg", "mass, 0 = absent", start=5.0, minimum=0.0, strength=True)
POSITION = Quantity(
    "position",
    "m",
    "where it sits, from the reference point in body axes",
    size=3,
    # a mass at the reference point does not tell where it sits; on either side it does, and what it
    # does is nearly linear in the place: 0.2 m are a hand's length on an arm, half a base's radius
    hints=SearchHints(tries=(-0.2, 0.2), times="mass"),
)

EFFECT = Effect("payload", "Mass fixed to a body.", ("body",), MASS, source="mechanics")


def law(e: EffectModel) -> None:
    """Add the mass."""
    m_p, p = e.parameter(MASS), e.parameter(POSITION)
    e.add_mass(m_p, p, ca.SX.zeros(3, 3))
    e.loss(0)
