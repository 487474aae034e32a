"""Drag of the rollers of an omni wheel against running across.

    rho_i = share_i rho

rho is the drag over the creep stiffness of the wheel along its direction, both per load: a base
that would translate at v by its wheels alone translates at v/(1 + rho) if they are equally loaded.
The softer the floor, the deeper the small rollers sink, and the larger rho is.

Not modelled: dry friction of the rollers, dependence on load and speed.

Source: linear creep along and drag across, balanced on the base (`omni_wheels/rolling`).
"""

from __future__ import annotations

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.signal_effect import share
from ..quantity import Quantity

RHO = Quantity(
    "rho",
    "1",
    "drag across over creep stiffness along the wheel, 0 = absent",
    start=0.2,
    minimum=0.0,
    strength=True,
)

EFFECT = Effect(
    "roller_drag",
    "Drag of the rollers of an omni wheel.",
    ("coefficient",),
    RHO,
    needs=("roller",),
    unit="1",
    source="linear creep",
)


def law(e: EffectModel) -> None:
    """Give the rollers their drag."""
    rho = e.parameter(RHO)
    e.add(rho * share(e))
