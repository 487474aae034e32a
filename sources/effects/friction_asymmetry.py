"""Friction that differs between the left and the right side of a vehicle.

    mu_left = mu (1 + d/2),  mu_right = mu (1 - d/2)

Not modelled: dependence on place or time (see `low_friction_patch`).

Source: relative difference, textbook.
"""

from __future__ import annotations

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

DIFFERENCE = Quantity(
    "difference",
    "1",
    "friction of the left side minus the right side, relative to the mean, 0 = absent",
    start=0.1,
    minimum=-1.9,
    maximum=1.9,
    strength=True,
)

EFFECT = Effect(
    "friction_asymmetry",
    "Friction that differs between left and right.",
    ("coefficient",),
    DIFFERENCE,
    needs=("side",),
    source="textbook",
)


def law(e: EffectModel) -> None:
    """Raise the coefficient on the left and lower it on the right."""
    d, s = e.parameter(DIFFERENCE), e.signals("side", mu="value")
    e.add(d / 2 * s.side * s.mu)
