"""Spring that stiffens with its deflection, as strain-wave gears do.

    f = -k_3 x^3,   E = k_3 x^4 / 4

Not modelled: hysteresis (effect of that name).

Source: Tuttle and Seering, A nonlinear model of a harmonic drive gear transmission, IEEE Trans.
Robotics and Automation 12(3), 1996.
"""

from __future__ import annotations

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

K_3 = Quantity(
    "k_3", "N.m/rad3", "torque per deflection cubed, 0 = absent", start=1e8, strength=True
)

EFFECT = Effect(
    "cubic_stiffness",
    "Spring that stiffens with deflection.",
    ("compliance",),
    K_3,
    source="Tuttle and Seering 1996",
)


def law(e: EffectModel) -> None:
    """Add the torque."""
    k_3, x = e.parameter(K_3), e.signal("deflection")
    e.add(-k_3 * x**3)
    e.stored_energy(k_3 * x**4 / 4)
    e.loss(0)
