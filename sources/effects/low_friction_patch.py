"""Slippery round patch on the floor.

    mu -> mu (1 - reduction exp(-(d/radius)^4)),   d: distance from the centre of the patch

Not modelled: a film that a wheel carries along.

Source: none, a shape with a flat middle and a smooth edge.
"""

from __future__ import annotations

import casadi as ca

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

REDUCTION = Quantity(
    "reduction",
    "1",
    "share of the friction coefficient that is lost, 0 = absent",
    start=0.8,
    minimum=0.0,
    maximum=1.0,
    strength=True,
)
X_P = Quantity(
    "x_p", "m", "world position of the centre", start=0.5, hints=SearchHints(visits="pose_x")
)
Y_P = Quantity("y_p", "m", "world position of the centre", hints=SearchHints(visits="pose_y"))
RADIUS = Quantity("radius", "m", "radius of the patch", start=0.3, minimum=1e-3)

EFFECT = Effect(
    "low_friction_patch",
    "Slippery patch on the floor.",
    ("coefficient",),
    REDUCTION,
    needs=("x", "y"),
    unit="1",
)


def law(e: EffectModel) -> None:
    """Lower the coefficient."""
    p, s = e.parameters(X_P, Y_P, RADIUS, REDUCTION), e.signals("x", "y", mu="value")
    d_squared = (s.x - p.x_p) ** 2 + (s.y - p.y_p) ** 2
    inside = ca.exp(-((d_squared / p.radius**2) ** 2))
    e.add(-p.reduction * inside * s.mu)
