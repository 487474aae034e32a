"""Dry friction of something that a body drags over the floor: a cable, a chain, a broom.

    u = v + w x p,   f = -F u / sqrt(|u|^2 + u_0^2)   at p,   P_loss = F |u|^2 / sqrt(|u|^2 + u_0^2)

in the plane of the floor: what is dragged follows the point where it hangs, with the same force
wherever that goes.

Not modelled: what is dragged has no mass and no length (a long cable follows round corners), the
weight that it takes off the body.

Source: Coulomb friction of a point.
"""

from __future__ import annotations

import casadi as ca

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

F = Quantity("F", "N", "friction force, 0 = absent", start=1.0, minimum=0.0, strength=True)
PLACE = Quantity(
    "place",
    "m",
    "where it hangs, from the reference point ahead and to the left",
    size=2,
    # one that hangs at the reference point does not turn the body; on either side it does, and its
    # moment is nearly linear in the place: 0.2 m are about half a small robot
    hints=SearchHints(tries=(-0.2, 0.2), times="F"),
)
U_0 = Quantity(
    "u_0", "m/s", "speed below which the force falls to 0", start=3e-3, minimum=1e-6, nominal=1e-2
)

EFFECT = Effect(
    "towed_friction",
    "Dry friction of something that is dragged over the floor.",
    ("body",),
    F,
    needs=("mass",),  # a body that stands on a floor drags over it, a tool in a hand does not
    source="Coulomb friction of a point",
)


def law(e: EffectModel) -> None:
    """Add the force at its point."""
    p, v, w = e.parameters(F, PLACE, U_0), e.signal("velocity"), e.signal("rate")[2]
    x, y = p.place[0], p.place[1]
    u = ca.vertcat(v[0] - w * y, v[1] + w * x)
    f = -p.F * u / ca.sqrt(ca.sumsqr(u) + p.u_0**2)
    e.add(ca.vertcat(f, ca.SX.zeros(3), x * f[1] - y * f[0]))
    e.loss(-ca.dot(f, u))
