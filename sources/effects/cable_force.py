"""Cable under constant tension, from a point of the body to an anchor in the world.

    F = T d/L,   E = T L,   L = sqrt(|d|^2 + d_0^2),   d = u/c - (r + R p)
    u = (cos(elevation) cos(bearing), cos(elevation) sin(bearing), sin(elevation))

The anchor lies in the direction u from the world's origin, at the distance 1/c: with c near 0 the
pull is the same everywhere. r and R are position and rotation of the body, p the body's point;
d_0 = 10 mm keeps the pull smooth at the anchor itself.

Not modelled: sag, friction of the reel, a cable that goes slack.

Source: statics; the tension of a spring reel is nearly constant.
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

TENSION = Quantity("tension", "N", "tension, 0 = absent", start=8.0, minimum=0.0, strength=True)
BEARING = Quantity(
    "bearing", "rad", "direction of the anchor from the world's origin, from x to y", mix="turn"
)
ELEVATION = Quantity(
    "elevation", "rad", "of that direction above the horizontal", minimum=-1.5, maximum=1.5
)
NEARNESS = Quantity(
    "c",
    "1/m",
    "1 over the distance of the anchor from the world's origin",
    start=0.05,
    minimum=1e-3,
    maximum=10.0,
)
POINT = Quantity(
    "point", "m", "where the cable is fixed, from the reference point in body axes", size=3
)
LENGTH = 0.01
"""Distance below which the pull fades [m]."""

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
    bearing, elevation = e.parameter(BEARING), e.parameter(ELEVATION)
    level = ca.cos(elevation)
    towards = ca.vertcat(level * ca.cos(bearing), level * ca.sin(bearing), ca.sin(elevation))
    rotation = e.signal("rotation")
    way = towards / e.parameter(NEARNESS) - e.signal("position") - rotation @ point
    length = ca.sqrt(ca.dot(way, way) + LENGTH**2)
    force = rotation.T @ (tension / length * way)
    e.add(ca.vertcat(force, ca.cross(point, force)))
    e.stored_energy(tension * length)
    e.loss(0)
