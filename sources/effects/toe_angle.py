"""Wheel whose plane is turned against the body: it drifts sideways as it rolls.

    plane of the wheel at angle delta to the body's x axis, positive to the left

Both wheels of an axle turned alike push the body sideways at about v delta, turned against each
other (`toe_angle@left.toe` alone, or both with opposite signs) they scrub.

Not modelled: camber.

Source: Pacejka, Tire and Vehicle Dynamics, 2012, ch. 1.
"""

from __future__ import annotations

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

DELTA = Quantity(
    "delta", "rad", "angle of the wheel's plane, 0 = absent", start=0.005, strength=True
)

EFFECT = Effect(
    "toe_angle",
    "Misaligned wheel.",
    ("coefficient",),
    DELTA,
    unit="rad",
    source="Pacejka 2012",
)


def law(e: EffectModel) -> None:
    """Turn the wheel."""
    e.add(e.parameter(DELTA))
