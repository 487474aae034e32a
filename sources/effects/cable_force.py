"""Cable under constant tension, from a point of the body to an anchor in the world.

    F = T d/L,   E = T L,   L = sqrt(|d|^2 + d_0^2),   d from the body's point to the anchor

Not modelled: sag, friction of the reel, a cable that goes slack.

Source: statics; the tension of a spring reel is nearly constant.
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

TENSION = Quantity("tension", "N", "tension, 0 = absent", start=8.0, minimum=0.0, strength=True)
ANCHOR = Quantity("anchor", "m", "world position of the anchor", start=(-1.0, 1.0, 1.0), size=3)
POINT = Quantity(
    "point", "m", "where the cable is fixed, from the reference point in body axes", size=3
)
LENGTH = Quantity(
    "d_0",
    "m",
    "distance below which the pull fades, so that it stays smooth",
    start=0.01,
    minimum=1e-6,
)

EFFECT = Effect(
    "cable_force",
    "Cable that pulls towards an anchor.",
    ("body",),
    TENSION,
    needs=("position", "rotation"),
    source="statics",
)


def law(e: EffectModel) -> None:
    """Add the pull."""
    tension, point = e.parameter(TENSION), e.parameter(POINT)
    rotation = e.signal("rotation")
    way = e.parameter(ANCHOR) - e.signal("position") - rotation @ point
    length = ca.sqrt(ca.dot(way, way) + e.parameter(LENGTH) ** 2)
    force = rotation.T @ (tension / length * way)
    e.add(ca.vertcat(force, ca.cross(point, force)))
    e.stored_energy(tension * length)
    e.loss(0)
