"""Slippery round patch on the floor.

    mu -> mu (1 - reduction (1 - tanh((d - radius)/edge))/2),   d: distance from the patch's centre

A spill ends sharply, dust does not: from nine tenths of what is lost to a tenth it is 2.2 times the
edge's width.

Not modelled: a film that a wheel carries along, patches that are not round.

Source: none, a shape with a flat middle and an edge as wide as it is.
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
EDGE = Quantity("edge", "m", "width of the patch's edge", start=0.03, minimum=1e-3, maximum=1.0)
SMALLEST = 1e-6
"""Distance [m] from the centre below which it has no direction."""

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
    p, s = e.parameters(X_P, Y_P, RADIUS, EDGE, REDUCTION), e.signals("x", "y", mu="value")
    d = ca.sqrt((s.x - p.x_p) ** 2 + (s.y - p.y_p) ** 2 + SMALLEST**2)
    inside = 0.5 * (1.0 - ca.tanh((d - p.radius) / p.edge))
    e.add(-p.reduction * inside * s.mu)
