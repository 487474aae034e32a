"""Wheel whose rolling radius is not the declared one, e.g. by wear or tyre pressure.

    r -> r + dr

On one wheel of two (`radius_offset@left.radius`) it bends a straight path.

Not modelled: dependence on load.

Source: Borenstein, Feng, IEEE Trans. Robotics and Automation 12(6), 1996 (unequal wheel diameters).
"""

from __future__ import annotations

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

DR = Quantity(
    "dr", "m", "difference of the radius, 0 = absent", start=3e-4, nominal=1e-3, strength=True
)

EFFECT = Effect(
    "radius_offset",
    "Wheel radius different from the declared one.",
    ("coefficient",),
    DR,
    needs=("angle",),
    unit="m",
    source="Borenstein, Feng 1996",
)


def law(e: EffectModel) -> None:
    """Shift the radius."""
    e.add(e.parameter(DR))
