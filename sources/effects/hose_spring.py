"""Hose or cable along a joint that pulls it back like a spring.

    f = -k (theta - theta_0),   E = k (theta - theta_0)^2 / 2

Not modelled: stiffening near the end of the travel, friction of the hose.

Source: Hooke's law.
"""

from __future__ import annotations

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.angle import shaft_angle
from ..quantity import Quantity

K = Quantity(
    "k", "N.m/rad", "stiffness, 0 = absent", start=2.0, minimum=0.0, nominal=1.0, strength=True
)
THETA_0 = Quantity(
    "theta_0", "rad", "angle at which the hose hangs free", hints=SearchHints(mix="shift")
)

EFFECT = Effect(
    "hose_spring",
    "Hose that pulls a joint back.",
    ("rotation",),
    K,
    source="Hooke's law",
)


def law(e: EffectModel) -> None:
    """Add the torque."""
    p, theta = e.parameters(K, THETA_0), shaft_angle(e, "velocity")
    stretch = theta - p.theta_0
    e.add(-p.k * stretch)
    e.stored_energy(p.k * stretch**2 / 2)
    e.loss(0)
