"""Cable under constant tension, from a point of the body to an anchor in the world.

    F = T d/L,   E = T L,   L = sqrt(|d|^2 + d_0^2),   d from the body's point to the anchor
    anchor = (r cos(psi), r sin(psi), h)   in the world

Far away, and at the mass centre, it pulls as gravity does on a slope.

Not modelled: sag, friction of the reel, a cable that goes slack.

Source: statics; the tension of a spring reel is nearly constant.
"""

from __future__ import annotations

import casadi as ca

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

# Bounds are those of a yard: a kilometre of cable, a mast of 100 m, a pit of 10, a machine of 5 m.
TENSION = Quantity("tension", "N", "tension, 0 = absent", start=8.0, minimum=0.0, strength=True)
HEADING = Quantity(
    "heading",
    "rad",
    "direction of the anchor from the world's origin, from its x axis",
    hints=SearchHints(mix="turn"),
)
DISTANCE = Quantity(
    "distance",
    "m",
    "distance of the anchor from the world's z axis",
    start=5.0,
    minimum=0.0,
    maximum=1e3,
)
HEIGHT = Quantity("height", "m", "height of the anchor in the world", minimum=-10.0, maximum=100.0)
POINT = Quantity(
    "point",
    "m",
    "where the cable is fixed, from the reference point in body axes",
    size=3,
    minimum=-5.0,
    maximum=5.0,
)
D_0 = Quantity(
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
    contains=("floor_slope",),
)


def law(e: EffectModel) -> None:
    """Add the pull."""
    p = e.parameters(T=TENSION, point=POINT, psi=HEADING, r=DISTANCE, h=HEIGHT, d_0=D_0)
    s = e.signals(x="position", R="rotation")
    anchor = ca.vertcat(p.r * ca.cos(p.psi), p.r * ca.sin(p.psi), p.h)
    d = anchor - s.x - s.R @ p.point
    L = ca.sqrt(ca.dot(d, d) + p.d_0**2)
    F = s.R.T @ (p.T / L * d)
    e.add(ca.vertcat(F, ca.cross(p.point, F)))
    e.stored_energy(p.T * L)
    e.loss(0)
