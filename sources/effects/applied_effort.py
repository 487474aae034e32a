"""Effort or error that is given from outside, over time.

    u = g u_in

u_in is an input of the FMU. It moves a model to where a log has been, so that laws can be asked
there what they would do; it says nothing about why.

Source: none, a definition.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca

from ..effect import KINDS, Effect
from ..effect_model import EffectModel
from ..laws.drivers import MOVING
from ..quantity import Quantity

G = Quantity("g", "1", "factor on the input, 0 = absent", start=1.0, strength=True)
U_IN = Quantity("u", "1", "the effort or error, in the unit of the balance")

EFFECT = Effect(
    "applied_effort",
    "Effort that is given from outside.",
    MOVING,
    G,
    source="a definition",
    probe=True,
)


def law(e: EffectModel) -> None:
    """Add the input."""
    g = e.parameter(G)
    size = 6 if e.kind == "body" else e.size
    u = g * e.input(replace(U_IN, size=size) if size > 1 else U_IN)
    e.add(u)
    flow = KINDS[e.kind].flow
    if flow:
        e.supply(ca.dot(u, e.signal(flow)))
    elif e.kind == "body":
        e.supply(ca.dot(u[:3], e.signal("velocity")) + ca.dot(u[3:], e.signal("rate")))
    e.loss(0)
