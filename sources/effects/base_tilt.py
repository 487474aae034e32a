"""Mount that stands on a tilted surface: gravity leans in the frame that was taken as level.

    g = g_0 turned by -tilt about the horizontal axis (cos heading, sin heading, 0)

With heading 0 a positive tilt raises the side of +y, with heading pi/2 it lowers that of +x.

Not modelled: a mount that gives way under load.

Source: rotation of a vector about an axis (Rodrigues).
"""

from __future__ import annotations

import casadi as ca

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

TILT = Quantity("tilt", "rad", "angle from the level, 0 = absent", start=0.01, strength=True)
HEADING = Quantity(
    "heading",
    "rad",
    "direction of the axis of tilt, from the x axis",
    hints=SearchHints(mix="turn"),
)

EFFECT = Effect(
    "base_tilt",
    "Mount on a tilted surface.",
    ("gravity",),
    TILT,
    source="rotation about an axis",
)


def law(e: EffectModel) -> None:
    """Turn gravity."""
    p, g_0 = e.parameters(TILT, HEADING), e.signal("value")
    axis = ca.vertcat(ca.cos(p.heading), ca.sin(p.heading), 0)
    across = g_0 - axis * ca.dot(axis, g_0)
    e.add(-ca.cross(axis, g_0) * ca.sin(p.tilt) - across * (1 - ca.cos(p.tilt)))
