"""Slip of a rolling wheel in proportion to its force and its speed.

    s = kappa |v| f,   added to the creep coefficient: c -> c + kappa sqrt(v^2 + v_0^2) - kappa v_0

On `creep_y` the wheel drifts sideways in curves, on `creep_x` it slips under traction.

Not modelled: saturation of the creepage before the friction limit.

Source: Kalker, Three-Dimensional Elastic Bodies in Rolling Contact, 1990 (linear theory).
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

KAPPA = Quantity(
    "kappa",
    "1/N",
    "creepage per force, 0 = absent",
    start=1.25e-4,
    minimum=0.0,
    nominal=1e-4,
    strength=True,
)
V_0 = Quantity("v_0", "m/s", "speed that counts as standstill", start=1e-3, minimum=1e-9)

EFFECT = Effect(
    "creepage",
    "Slip in proportion to force and rolling speed.",
    ("coefficient",),
    KAPPA,
    needs=("speed",),
    unit="m/(N.s)",
    source="Kalker 1990",
)


def law(e: EffectModel) -> None:
    """Soften the contact."""
    p, v = e.parameters(V_0, KAPPA), e.signal("speed")
    e.add(p.kappa * (ca.sqrt(v**2 + p.v_0**2) - p.v_0))
