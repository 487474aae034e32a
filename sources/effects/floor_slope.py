"""Floor that rises in one direction of the world.

    g = g_0 + |g_0| (-sin(slope) cos(heading), -sin(slope) sin(heading), 1 - cos(slope))

in world axes, which stay those of the floor. Positive slope rises towards the heading.

Not modelled: the effect's own payloads on the slope, an arm beyond the weight that the base carries
for it (give the arm its tilt by `base_tilt`).

Source: statics.
"""

from __future__ import annotations

import casadi as ca

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

SLOPE = Quantity("slope", "rad", "angle of the slope, 0 = absent", start=0.005, strength=True)
HEADING = Quantity(
    "heading",
    "rad",
    "direction in which the floor rises, from the world x axis",
    hints=SearchHints(mix="turn"),
)

EFFECT = Effect(
    "floor_slope",
    "Sloping floor.",
    ("body",),
    SLOPE,
    needs=("rotation", "mass", "first_moment"),
    source="statics",
)


def law(e: EffectModel) -> None:
    """Add the wrench of the leaning gravity."""
    p, s = e.parameters(SLOPE, HEADING), e.signals("mass", "first_moment", R="rotation")
    g_0 = -(s.R @ e.signal("gravity"))[2]
    lean = g_0 * ca.vertcat(
        -ca.sin(p.slope) * ca.cos(p.heading),
        -ca.sin(p.slope) * ca.sin(p.heading),
        1 - ca.cos(p.slope),
    )
    change = s.R.T @ lean
    force = s.mass * change
    moment = ca.cross(s.first_moment, change)
    e.add(ca.vertcat(force, moment))
    e.supply(ca.dot(force, e.signal("velocity")) + ca.dot(moment, e.signal("rate")))
    e.loss(0)
