"""Mass centre away from where it is taken to be.

    r_G = r_G0 + d (cos gamma, sin gamma, 0)

The component decides what follows: wheel loads, and the inertial forces of the moving mass.

Not modelled: the change of the inertia about the mass centre that moving a part of the mass brings.

Source: crawler paper, Table 1 (the V-axis moves with the load).
"""

from __future__ import annotations

import casadi as ca

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

SHIFT = Quantity(
    "shift",
    "m",
    "shift of the mass centre, 0 = absent",
    start=0.02,
    strength=True,
)
DIRECTION = Quantity(
    "direction",
    "rad",
    "direction of the shift, 0 forward, positive to the left",
    hints=SearchHints(mix="turn"),
)

EFFECT = Effect(
    "load_shift",
    "Mass centre away from its nominal place, as a load off the centre puts it.",
    ("position",),
    SHIFT,
    source="crawler paper, Table 1",
)


def law(e: EffectModel) -> None:
    """Move the mass centre."""
    d, gamma = e.parameter(SHIFT), e.parameter(DIRECTION)
    e.add(ca.vertcat(d * ca.cos(gamma), d * ca.sin(gamma), 0))
