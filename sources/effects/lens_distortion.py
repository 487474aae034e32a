"""Lens of a camera that draws what is far from its axis too far out, or too near.

    p_meas = p + k |p - c|^2 (p - c)

k > 0 is a pincushion, k < 0 a barrel; c is where the axis meets the floor. A picture of several
points has them one by one.

Not modelled: higher orders, tangential distortion, perspective.

Source: Brown, Decentering distortion of lenses, Photogrammetric Engineering 32(3), 1966.
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

K = Quantity(
    "k", "1/m2", "growth of the scale with the square of the distance, 0 = absent", start=1e-3,
    strength=True,
)  # fmt: skip
CENTRE = Quantity("centre", "m", "where the camera's axis meets the floor", size=2)

EFFECT = Effect(
    "lens_distortion",
    "Radial distortion of a camera's lens.",
    ("picture", "point"),
    K,
    source="Brown 1966",
)


def law(e: EffectModel) -> None:
    """Move the points along their rays."""
    p, value = e.parameters(K, CENTRE), e.signal("value")
    count = e.size // 2
    x, y = value[:count] - p.centre[0], value[count : 2 * count] - p.centre[1]
    grown = p.k * (x**2 + y**2)
    e.add(ca.vertcat(grown * x, grown * y, ca.SX.zeros(e.size - 2 * count)))
