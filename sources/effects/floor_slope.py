"""Floor that rises in one direction of the world.

    g = g_0 + |g_0| (-sin(slope) cos(heading), -sin(slope) sin(heading), 1 - cos(slope))

in world axes, which stay those of the floor. Positive slope rises towards the heading.

An arm on the base feels it in `mount_acceleration`: a mount that is held on a slope and one that
accelerates are one to it. A payload of the same body feels it, too.

Not modelled: the energy that the arm gains going downhill, in the arm's own account.

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
    """Let gravity lean."""
    p, R = e.parameters(SLOPE, HEADING), e.signal("rotation")
    g_0 = -(R @ e.signal("gravity"))[2]
    lean = g_0 * ca.vertcat(
        -ca.sin(p.slope) * ca.cos(p.heading),
        -ca.sin(p.slope) * ca.sin(p.heading),
        1 - ca.cos(p.slope),
    )
    e.lean(R.T @ lean)
    e.loss(0)
